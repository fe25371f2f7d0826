// pipeline/preview_main.cpp: the program lamina-preview, which `lamina preview` hands over to.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <optional>

#include "pipeline/command_line.h"
#include "pipeline/console.h"
#include "pipeline/manifest.h"
#include "pipeline/preview_swath.h"
#include "pipeline/slice_picture.h"
#include "stages/write/atomic_file.h"
#include "stages/write/picture/canvas.h"
#include "stages/write/picture/contact_sheet.h"
#include "stages/write/picture/drawing.h"
#include "stages/write/picture/plan_view.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kMostCells = 400;

/// The number behind a flag; nothing if the flag is absent.
Result<std::optional<std::uint32_t>> number(const Arguments& arguments, std::string_view flag, std::uint32_t least,
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

Result<Manifest> manifest_of(const std::string& directory) {
  std::error_code ignored;
  const std::string whole = directory + "/manifest.json", part = whole + ".part";
  if (!std::filesystem::exists(whole, ignored) && std::filesystem::exists(part, ignored)) return read_manifest(part);
  if (!std::filesystem::exists(whole, ignored)) {
    return Error{Fault::kVerification,
                 fmt::format("{}: no manifest.json; name a directory that lamina jet or lamina slice wrote (shards: run "
                             "lamina merge first)",
                             directory)};
  }
  return read_manifest(whole);
}

/// Which of a job's layers are drawn: places in the list of their numbers.
Result<std::vector<std::size_t>> chosen_layers(const Arguments& arguments, const std::vector<std::uint32_t>& layers) {
  const auto layer_read = number(arguments, "--layer", 0, UINT32_MAX);
  const auto every_read = number(arguments, "--every", 1, UINT32_MAX);
  const auto count_read = number(arguments, "--count", 1, kMostCells);
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

std::string title_of(const ManifestHead& head) {
  std::string title;
  if (!head.parts.empty()) {
    title = std::filesystem::path(head.parts.front().path).filename().string();
    if (head.parts.size() > 1) title += fmt::format(" and {} more", head.parts.size() - 1);
    title += "   |   ";
  }
  return title + fmt::format("{} layers   |   {:g} x {:g} dpi   |   bed {:g} x {:g} mm", head.layer_count, head.grid.x.dpi(),
                             head.grid.y.dpi(), mm(head.grid.x.length), mm(head.grid.y.length));
}

write::picture::PlanView view_of(LayerShapes& shapes) {
  write::picture::PlanView view;
  view.title = shapes.title;
  view.caption = shapes.caption;
  view.box = shapes.box;
  view.region = shapes.contours;
  constexpr write::picture::Colour kInks[] = {{176, 58, 46}, {214, 137, 16}, {36, 113, 163}, {17, 120, 100}, {142, 68, 173}};
  for (LayerShapes::Beads& beads : shapes.beads) {
    view.shapes.push_back({kInks[static_cast<std::size_t>(beads.kind)], beads.name, std::move(beads.outline)});
  }
  return view;
}

/// Several layers of what lamina slice wrote.
int preview_slice_sheet(const SlicePictures& pictures, const std::string& output, const Arguments& arguments,
                        std::uint32_t width) {
  if (std::filesystem::path(output).extension() == ".svg") {
    return fail({Fault::kUsage, "-o: an SVG shows one layer, choose it by --layer K; several are drawn as PNG"});
  }
  std::vector<std::uint32_t> layers(pictures.last() - pictures.first());
  std::iota(layers.begin(), layers.end(), pictures.first());
  const auto chosen = chosen_layers(arguments, layers);
  if (!chosen) return fail(chosen.error());
  if (chosen->empty()) return fail({Fault::kVerification, "the job has no layers"});
  Result<LayerShapes> shapes = pictures.layer(layers[chosen->front()]);
  if (!shapes) return fail(shapes.error());
  const std::string title =
      fmt::format("{}   |   {} layers   |   {:.1f} x {:.1f} mm", shapes->title.substr(0, shapes->title.find("   |")),
                  pictures.count(), mm(shapes->box.width()), mm(shapes->box.depth()));
  const auto layer_view = [&](std::size_t i) -> Result<write::picture::PlanView> {
    if (i > 0) shapes = pictures.layer(layers[(*chosen)[i]]);
    if (!shapes) return shapes.error();
    write::picture::PlanView view = view_of(*shapes);
    view.title = fmt::format("layer {}", shapes->layer.index);
    view.caption = fmt::format("z {:.3f} mm", mm(shapes->layer.plane()));
    return view;
  };
  const auto picture = write::picture::plan_sheet(title, chosen->size(), shapes->box, width, layer_view);
  if (!picture) return fail(picture.error());
  if (const Status status = write::write_file(output, *picture); !status) return fail(status.error());
  if (!arguments.has("--quiet")) {
    say(fmt::format("{}: {} of {} layers, {}", output, chosen->size(), pictures.count(), readable_bytes(picture->size())));
  }
  return 0;
}

/// One layer of what lamina slice wrote, or several.
int preview_slice(const std::string& directory, const std::string& output, const Arguments& arguments, std::uint32_t width) {
  for (const std::string_view option : {"--whole-bed", "--swath"}) {
    if (arguments.has(option)) {
      return fail({Fault::kUsage,
                   fmt::format("{}: is for images; of a sliced job what its parts cover is drawn, leave it out", option)});
    }
  }
  const auto layer = number(arguments, "--layer", 0, UINT32_MAX);
  if (!layer) return fail(layer.error());
  const auto pictures = SlicePictures::open(directory);
  if (!pictures) return fail(pictures.error());
  if (arguments.has("--every") || arguments.has("--count")) return preview_slice_sheet(*pictures, output, arguments, width);
  Result<LayerShapes> shapes = pictures->layer((*layer).value_or(pictures->count() / 2));
  if (!shapes) return fail(shapes.error());
  Status status;
  if (std::filesystem::path(output).extension() == ".svg") {
    const std::string svg = shapes_svg(*shapes);
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

// A plot that another command wrote down as boxes and lines of text.
int run_drawing(const std::string& path, const std::string& output) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail({Fault::kUsage, fmt::format("--drawing {}: cannot be read", path)});
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  file.close();
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  const Result<Buffer<std::byte>> picture = write::picture::drawing_png(text);
  if (!picture) return fail({picture.error().fault, fmt::format("--drawing {}: {}", path, picture.error().message)});
  const Status status = write::write_file(output, *picture);
  return status ? 0 : fail(status.error());
}

int run_preview(const std::vector<std::string>& texts) {
  const Result<Arguments> arguments = read_arguments(preview_spec(), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) {
    const Status status = print(*arguments->help);
    return status ? 0 : fail(status.error());
  }
  if (arguments->has("--drawing")) return run_drawing(arguments->text("--drawing"), arguments->text("-o,--output"));
  if (arguments->operands.size() != 1) return fail({Fault::kUsage, "name one directory that lamina jet or lamina slice wrote"});
  const std::string directory = arguments->operands.front(), output = arguments->text("-o,--output");
  if (output.empty()) return fail({Fault::kUsage, "-o PNG is missing; name the picture"});
  const auto width_of_slice = number(*arguments, "--width", 200, 20'000);
  if (!width_of_slice) return fail(width_of_slice.error());
  const std::string extension = std::filesystem::path(output).extension();
  if (is_slice_directory(directory) && (extension == ".png" || extension == ".svg")) {
    return preview_slice(directory, output, *arguments, (*width_of_slice).value_or(2400));
  }
  if (extension != ".png") {
    return fail({Fault::kUsage, fmt::format("-o {}: pictures are PNG; end the name with .png", output)});
  }
  const auto width = number(*arguments, "--width", 200, 20'000);
  if (!width) return fail(width.error());
  const Result<Manifest> manifest = manifest_of(directory);
  if (!manifest) return fail(manifest.error());
  if (manifest->layers.empty()) return fail({Fault::kVerification, directory + ": the manifest has no layers yet"});
  if (manifest->head.extension.empty()) {
    return fail(
        {Fault::kVerification, fmt::format("{}: the job wrote no images (format {}); plan it with another format, as tiff-g4",
                                           directory, manifest->head.format)});
  }
  if (arguments->has("--swath")) {
    SwathChoice choice;
    const auto layer = number(*arguments, "--layer", 0, UINT32_MAX), step = number(*arguments, "--step", 0, UINT32_MAX);
    const bool middle = arguments->text("--swath") == "middle";
    const auto swath =
        middle ? Result<std::optional<std::uint32_t>>(std::nullopt) : number(*arguments, "--swath", 0, UINT32_MAX);
    for (const auto* option : {&layer, &step, &swath}) {
      if (!*option) return fail(option->error());
    }
    choice.layer = (*layer).value_or(manifest->layers[manifest->layers.size() / 2].layer.index);
    choice.swath = *swath;
    choice.step = *step;
    choice.width = (*width).value_or(1200);
    const auto picture = draw_swath(directory, *manifest, choice);
    if (!picture) return fail(picture.error());
    if (const Status status = write::write_file(output, *picture); !status) return fail(status.error());
    if (!arguments->has("--quiet")) say(fmt::format("{}: layer {}, {}", output, choice.layer, readable_bytes(picture->size())));
    return 0;
  }
  std::vector<std::uint32_t> numbers;
  for (const LayerRecord& record : manifest->layers) numbers.push_back(record.layer.index);
  const Result<std::vector<std::size_t>> chosen = chosen_layers(*arguments, numbers);
  if (!chosen) return fail(chosen.error());

  write::picture::SheetRequest request;
  request.title = title_of(manifest->head);
  request.grid = manifest->head.grid;
  request.whole_bed = arguments->has("--whole-bed");
  request.width = (*width).value_or(2400);
  for (const std::size_t index : *chosen) {
    const LayerRecord& record = manifest->layers[index];
    const auto images = layer_images(manifest->head, record);
    for (std::size_t m = 0; m < images.size(); ++m) {
      const std::string material = manifest->head.materials.empty() ? "" : ", " + manifest->head.materials[m].name;
      request.layers.push_back({(std::filesystem::path(directory) / images[m].name).string(),
                                fmt::format("layer {}{}", record.layer.index, material),
                                fmt::format("z {:.3f} mm", mm(record.layer.plane()))});
    }
  }
  const Result<Buffer<std::byte>> picture = write::picture::contact_sheet(request);
  if (!picture) return fail(picture.error());
  if (const Status status = write::write_file(output, *picture); !status) return fail(status.error());
  if (!arguments->has("--quiet")) {
    if (!write::picture::have_font()) say("lamina: no captions: no font; install fonts-dejavu-core");
    say(fmt::format("{}: {} of {} layers, {}", output, chosen->size(), manifest->head.layer_count,
                    readable_bytes(picture->size())));
  }
  return 0;
}

}  // namespace
}  // namespace lamina::pipeline

int main(int argc, char** argv) {
  // A full disk and a closed pipe are reported by the calls that meet them.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return lamina::pipeline::run_preview({argv + 1, argv + argc});
  } catch (const std::exception& exception) {
    return lamina::pipeline::fail({lamina::Fault::kInternal, exception.what()});
  }
}
