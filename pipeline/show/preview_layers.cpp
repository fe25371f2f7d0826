#include "pipeline/show/preview_layers.h"
#include "pipeline/text/readable.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <numeric>
#include <optional>

#include "pipeline/cli/console.h"
#include "stages/write/file.h"
#include "stages/write/picture/plan_view.h"
#include "stages/write/svg/drawing.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kMostCells = 400;

write::picture::PlanView view_of(view::LayerShapes& shapes) {
  write::picture::PlanView view;
  view.title = shapes.title;
  view.caption = shapes.caption;
  view.box = shapes.box;
  view.region = shapes.contours;
  for (view::LayerShapes::Beads& beads : shapes.beads) {
    view.shapes.push_back({{beads.ink[0], beads.ink[1], beads.ink[2]}, beads.name, std::move(beads.outline)});
  }
  return view;
}

/// The layer in its true size, bead widths true.
std::string svg_of(const view::LayerShapes& shapes) {
  std::vector<write::svg::Region> regions{{shapes.contours, "solid", {205, 209, 216}}};
  for (const view::LayerShapes::Beads& beads : shapes.beads) regions.push_back({beads.outline, beads.name, beads.ink});
  return write::svg::drawing(shapes.box, regions);
}

/// Several layers side by side.
int draw_sheet(const view::LayerSeries& series, const std::string& output, const Arguments& arguments, std::uint32_t width) {
  if (std::filesystem::path(output).extension() == ".svg") {
    return fail({Fault::kUsage, "-o: an SVG shows one layer, choose it by --layer K; several are drawn as PNG"});
  }
  std::vector<std::uint32_t> layers(series.last - series.first);
  std::iota(layers.begin(), layers.end(), series.first);
  const auto chosen = chosen_layers(arguments, layers);
  if (!chosen) return fail(chosen.error());
  if (chosen->empty()) return fail({Fault::kVerification, "the job has no layers"});
  Result<view::LayerShapes> shapes = series.layer(layers[chosen->front()]);
  if (!shapes) return fail(shapes.error());
  const std::string title = fmt::format("{}   |   {} layers   |   {:.1f} x {:.1f} mm", series.name, series.count,
                                        mm(shapes->box.width()), mm(shapes->box.depth()));
  const auto layer_view = [&](std::size_t i) -> Result<write::picture::PlanView> {
    if (i > 0) shapes = series.layer(layers[(*chosen)[i]]);
    if (!shapes) return shapes.error();
    write::picture::PlanView view = view_of(*shapes);
    view.title = fmt::format("layer {}", shapes->index);
    view.caption = fmt::format("z {:.3f} mm", mm(shapes->z));
    return view;
  };
  const auto picture = write::picture::plan_sheet(title, chosen->size(), shapes->box, width, layer_view);
  if (!picture) return fail(picture.error());
  if (const Status status = write::write_file(output, *picture); !status) return fail(status.error());
  if (!arguments.has("--quiet")) {
    say(fmt::format("{}: {} of {} layers, {}", output, chosen->size(), series.count, readable_bytes(picture->size())));
  }
  return 0;
}

}  // namespace

Result<std::optional<std::uint32_t>> whole_number(const Arguments& arguments, std::string_view flag, std::uint32_t least,
                                                  std::uint32_t most) {
  if (!arguments.has(flag)) return std::optional<std::uint32_t>();
  const std::string text = arguments.text(flag);
  std::uint32_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || value < least || value > most) {
    return Error{Fault::kUsage, fmt::format("{} {}: give a whole number from {} to {}", flag, text, least, most)};
  }
  return std::optional<std::uint32_t>(value);
}

Result<std::vector<std::size_t>> chosen_layers(const Arguments& arguments, const std::vector<std::uint32_t>& layers) {
  const auto layer_read = whole_number(arguments, "--layer", 0, UINT32_MAX);
  const auto every_read = whole_number(arguments, "--every", 1, UINT32_MAX);
  const auto count_read = whole_number(arguments, "--count", 1, kMostCells);
  for (const auto* option : {&layer_read, &every_read, &count_read}) {
    if (!*option) return option->error();
  }
  const std::optional<std::uint32_t> layer = *layer_read, every = *every_read, count = *count_read;
  if (layer.has_value() + every.has_value() + count.has_value() > 1) {
    return Error{Fault::kUsage, "--layer, --every and --count exclude each other; give one of them"};
  }
  std::vector<std::size_t> chosen;
  if (layer) {
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (layers[i] == *layer) return std::vector<std::size_t>{i};
    }
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers {} to {}", *layer, layers.front(), layers.back())};
  }
  if (every) {
    const std::size_t cells = (layers.size() + *every - 1) / *every;
    if (cells > kMostCells) {
      return Error{Fault::kUsage, fmt::format("--every {}: {} layers are too many for a picture; give {} or more", *every,
                                              cells, (layers.size() + kMostCells - 1) / kMostCells)};
    }
    for (std::size_t i = 0; i < layers.size(); i += *every) chosen.push_back(i);
    return chosen;
  }
  // The middle one of each of `cells` equal stretches of the height.
  const std::size_t cells = std::min<std::size_t>(count.value_or(12), layers.size());
  for (std::size_t cell = 0; cell < cells; ++cell) chosen.push_back((2 * cell + 1) * layers.size() / (2 * cells));
  return chosen;
}

int preview_series(const view::LayerSeries& series, const std::string& output, const Arguments& arguments,
                   std::uint32_t width) {
  for (const std::string_view option : {"--whole-bed", "--swath", "--step"}) {
    if (arguments.has(option)) {
      return fail({Fault::kUsage,
                   fmt::format("{}: is for images; of slices and toolpaths what they cover is drawn, leave it out", option)});
    }
  }
  if (arguments.has("--every") || arguments.has("--count")) return draw_sheet(series, output, arguments, width);
  const auto layer = whole_number(arguments, "--layer", 0, UINT32_MAX);
  if (!layer) return fail(layer.error());
  Result<view::LayerShapes> shapes = series.layer((*layer).value_or(series.count / 2));
  if (!shapes) return fail(shapes.error());
  Status status;
  if (std::filesystem::path(output).extension() == ".svg") {
    const std::string svg = svg_of(*shapes);
    status = write::write_file(output, std::as_bytes(std::span(svg)));
  } else {
    write::picture::PlanView view = view_of(*shapes);
    view.width = width;
    const auto picture = write::picture::plan_view(view);
    if (!picture) return fail(picture.error());
    status = write::write_file(output, *picture);
  }
  if (!status) return fail(status.error());
  if (!arguments.has("--quiet")) say(fmt::format("{}: {}", output, shapes->title));
  return 0;
}

}  // namespace lamina::pipeline
