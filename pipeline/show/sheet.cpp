// Part of lamina-preview, which links the picture libraries.
#include "pipeline/show/sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "pipeline/check/job_files.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/show/series.h"
#include "stages/formats/images/image.h"
#include "stages/formats/svg/svg.h"
#include "stages/formats/svg/svg_writer.h"
#include "stages/geometry/combine.h"
#include "stages/replay/jetting.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"
#include "stages/view/picture/canvas.h"
#include "stages/view/picture/contact_sheet.h"
#include "stages/view/picture/plan_view.h"
#include "stages/view/picture/swath_view.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kSheetWidth = 2400, kSwathWidth = 1200;

Result<Manifest> manifest_of(const std::string& directory) {
  std::error_code ignored;
  const std::string whole = directory + "/manifest.json", part = whole + ".part";
  if (!is_file(whole) && is_file(part)) return read_manifest(part);
  if (!std::filesystem::exists(directory, ignored)) {
    return Error{Fault::kUsage, fmt::format("{}: no such directory or file", directory)};
  }
  if (!is_file(whole)) {
    return Error{Fault::kVerification,
                 fmt::format("{}: no manifest.json; name a directory that lamina jet or lamina slice wrote (shards: run "
                             "lamina merge first)",
                             directory)};
  }
  return read_manifest(whole);
}

std::string title_of(const ManifestHead& head) {
  const std::string parts = lamina::title_of(head.parts);
  std::string title = parts.empty() ? "" : parts + "   |   ";
  title += fmt::format("{} layers   |   {:g} x {:g} dpi   |   bed {:g} x {:g} mm", head.layer_count, head.grid.x.dpi(),
                       head.grid.y.dpi(), mm(head.grid.x.length), mm(head.grid.y.length));
  if (const int maximum = head.max_of_pixel(); maximum > 1)
    title +=
        head.max_drops > 0 ? fmt::format("   |   darkest {} drops", maximum) : fmt::format("   |   darkest level {}", maximum);
  return title;
}

/// Several layers side by side.
Result<Preview> draw_series_sheet(const view::LayerSeries& series, const PreviewRequest& request) {
  std::vector<std::uint32_t> layers(series.last - series.first);
  std::iota(layers.begin(), layers.end(), series.first);
  const auto chosen = chosen_layers(request.layers, layers);
  if (!chosen) return chosen.error();
  if (chosen->empty()) return Error{Fault::kVerification, "the job has no layers"};
  Result<LayerShapes> shapes = series.layer(layers[chosen->front()]);
  if (!shapes) return shapes.error();
  const std::string title = fmt::format("{}   |   {} layers   |   {:.1f} x {:.1f} mm", series.name, series.count,
                                        mm(shapes->box.width()), mm(shapes->box.depth()));
  const Box box = shapes->box;
  const auto captioned = [&](std::size_t i) {
    Result<LayerShapes> layer = i > 0 ? series.layer(layers[(*chosen)[i]]) : std::move(shapes);
    if (!layer) return layer;
    layer->title = fmt::format("layer {}", layer->index);
    layer->caption = fmt::format("z {:.3f} mm", mm(layer->z));
    return layer;
  };
  auto picture = view::picture::plan_sheet(title, chosen->size(), box, request.width.value_or(kSheetWidth), captioned);
  if (!picture) return picture.error();
  const std::string said =
      fmt::format("{}: {} of {} layers, {}", request.output, chosen->size(), series.count, readable_bytes(picture->size()));
  return Preview{std::move(*picture), said};
}

/// Draws one layer of shapes, or several side by side.
Result<Preview> draw_series(const view::LayerSeries& series, const PreviewRequest& request, bool svg) {
  for (const auto& [given, option] :
       {std::pair{request.whole_bed, "--whole-bed"}, {request.swath, "--swath"}, {request.step.has_value(), "--step"}}) {
    if (given) {
      return Error{Fault::kUsage,
                   fmt::format("{}: is for images; of slices and toolpaths what they cover is drawn, leave it out", option)};
    }
  }
  if (request.layers.every || request.layers.count) {
    if (!svg) return draw_series_sheet(series, request);
    return Error{Fault::kUsage, "-o: an SVG shows one layer, choose it by --layer K; several are drawn as PNG"};
  }
  if (svg && request.width) {
    return Error{Fault::kUsage, "--width: applies to pictures of pixels, an SVG is in mm; leave it out, or name a .png"};
  }
  Result<LayerShapes> shapes = series.layer(request.layers.layer.value_or(series.count / 2));
  if (!shapes) return shapes.error();
  const std::string said = fmt::format("{}: {}", request.output, shapes->title);
  if (svg) {
    const std::string text = formats::svg_drawing(*shapes);
    const auto bytes = std::as_bytes(std::span(text));
    return Preview{{bytes.begin(), bytes.end()}, said};
  }
  auto picture = view::picture::plan_view(*shapes, request.width.value_or(kSheetWidth));
  if (!picture) return picture.error();
  return Preview{std::move(*picture), said};
}

/// Replays the layer's program up to the step and draws the drops jetted so far, `width` pixels wide. errors  kUsage: no
/// such layer, swath or step; kVerification: missing or changed files; kInternal
Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const replay::StepChoice& choice,
                                     std::uint32_t width) {
  const ManifestHead& head = manifest.head;
  if (head.machine.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: the job has no print program; plan it with --machine", directory)};
  }
  const auto record =
      std::ranges::find_if(manifest.layers, [&](const LayerRecord& one) { return one.layer.index == choice.layer; });
  if (record == manifest.layers.end()) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers {} to {}", choice.layer,
                                            manifest.layers.front().layer.index, manifest.layers.back().layer.index)};
  }
  const auto machine = machine_of_job(directory, head);
  if (!machine)
    return Error{machine.error().fault,
                 fmt::format("{}/{}; run lamina verify for details", directory, machine.error().message)};
  const auto expected = ExpectedDrops::of(head, machine->profile());
  if (!expected) return expected.error();
  if (Status status = check_images(directory, head, *record); !status) return status.error();
  const auto image = picture_of_layer(directory, head, *record, *expected);
  if (!image) return image.error();
  const auto program = program_of_layer(directory, head, *record);
  if (!program) return program.error();
  replay::StepChoice step = choice;
  step.planes = std::max(1u, head.max_drops);
  const auto jetting = replay::jet_until(*machine, *program, step, head.grid);
  if (!jetting) return jetting.error();
  view::picture::SwathView view;
  view.grid = head.grid;
  view.width = width;
  const Levels requested = times_set(*image);
  view.image = requested;
  view.fired = jetting->printed;
  view.maximum = head.max_of_pixel();
  view.bands = jetting->bands;
  view.nozzles = jetting->nozzles;
  view.title = fmt::format("{}, layer {}, swath {} ({} of {} that fire), step {}", head.machine, choice.layer, jetting->swath,
                           jetting->position, jetting->sweeps, jetting->step);
  view.caption = fmt::format("{} of {} drops fired (dark); {} of {} nozzles fire at this step (red)", jetting->fired,
                             jetting->drops, jetting->firing, jetting->nozzles.size());
  if (view.maximum > 1) view.caption += fmt::format("; darkest {} drops", view.maximum);
  return view::picture::swath_picture(view);
}

/// Draws a layer at a step of its program.
Result<Preview> draw_jetting(const Manifest& manifest, const PreviewRequest& request) {
  const std::uint32_t middle = manifest.layers[manifest.layers.size() / 2].layer.index;
  const replay::StepChoice choice{request.layers.layer.value_or(middle), request.swath_number, request.step};
  auto picture = draw_swath(request.source, manifest, choice, request.width.value_or(kSwathWidth));
  if (!picture) return picture.error();
  const std::string said = fmt::format("{}: layer {}, {}", request.output, choice.layer, readable_bytes(picture->size()));
  return Preview{std::move(*picture), said};
}

/// The drops of an image of the geometry, made again row by row.
Result<view::picture::SheetImage> made_again(const ExpectedDrops& expected, const Layer& layer, Runs&& geometry) {
  struct Made {
    Runs geometry;
    LayerDrops drops;
  };
  const auto made = std::make_shared<Made>(Made{std::move(geometry), {}});
  if (Status status = expected.make(layer, {&made->geometry, 1}, made->drops); !status) return status.error();
  view::picture::SheetImage image;
  for (const BitRows* const plane : made->drops.planes()) image.planes.emplace_back(made, plane);
  return image;
}

/// The image of a file; of the geometry, its drops where `expected` makes them.
Result<view::picture::SheetImage> read_sheet_image(const ManifestHead& head, const ExpectedDrops& expected, const Layer& layer,
                                                   const std::string& path) {
  if (!is_one_bit(head)) {
    auto levels = formats::image_levels(path, head.full_level());
    if (!levels) return levels.error();
    return view::picture::SheetImage{std::move(*levels), {}};
  }
  auto image = formats::image(path, 0, expected.remakes() ? Keep::kRuns : Keep::kSmaller);
  if (!image) return image.error();
  const bool fits = image->columns == head.grid.columns() && image->rows == head.grid.rows();  // else the sheet refuses it
  if (expected.remakes() && fits) return made_again(expected, layer, std::move(image->runs));
  if (image->bits) return view::picture::SheetImage{{}, {std::move(image->bits)}};
  view::picture::SheetImage made;
  levels_of(image->runs, 1, made.levels);
  return made;
}

/// Draws images side by side; those of the geometry with their drops, or where the machine's profile is lost, as they are.
Result<Preview> draw_images(const Manifest& manifest, const PreviewRequest& request) {
  std::vector<std::uint32_t> numbers;
  for (const LayerRecord& record : manifest.layers) numbers.push_back(record.layer.index);
  const auto chosen = chosen_layers(request.layers, numbers);
  if (!chosen) return chosen.error();
  const ManifestHead& head = manifest.head;
  const std::filesystem::path folder = request.source;
  const auto drops = ExpectedDrops::of(request.source, head);
  const ExpectedDrops none, &expected = drops ? *drops : none;
  view::picture::SheetRequest sheet;
  sheet.title = drops ? title_of(head) : title_of(head) + "   |   geometry without drops";
  sheet.grid = head.grid;
  sheet.maximum = drops ? head.max_of_pixel() : 1;
  sheet.whole_bed = request.whole_bed;
  sheet.width = request.width.value_or(kSheetWidth);
  sheet.memory_bytes = request.memory_bytes;
  std::vector<Layer> layer_of;  // of each cell
  for (const std::size_t index : *chosen) {
    const LayerRecord& record = manifest.layers[index];
    if (Status status = check_images(request.source, head, record); !status) return status.error();
    const auto images = layer_images(head, record);
    for (std::size_t first = 0; first < images.size(); first += head.drop_images()) {  // of each material
      view::picture::SheetLayer cell;
      cell.bytes = expected.remakes() ? bytes_to_make(head, record)
                                      : bytes_to_read(head, record, is_one_bit(head) ? Keep::kSmaller : Keep::kRuns);
      for (std::size_t drop = 0; drop < head.drop_images(); ++drop)
        cell.paths.push_back((folder / images[first + drop].name).string());
      cell.warns = images[first].record.unfed_pixels > 0;
      cell.name = fmt::format("layer {}", record.layer.index);
      if (!head.materials.empty()) cell.name += ", " + head.materials[first / head.drop_images()].name;
      if (cell.warns) cell.name += " in another powder";
      cell.remark = fmt::format("z {:.3f} mm", mm(record.layer.plane()));
      sheet.layers.push_back(std::move(cell));
      layer_of.push_back(record.layer);
    }
  }
  const auto read = [&](std::size_t cell, const std::string& path) {
    return read_sheet_image(head, expected, layer_of[cell], path);
  };
  auto picture = view::picture::contact_sheet(sheet, read);
  if (!picture) return picture.error();
  const std::size_t made = manifest.layers.size(), all = head.layer_count;
  Preview preview{std::move(*picture), fmt::format("{}: {} of {} layers{}, ", request.output, chosen->size(), made,
                                                   made == all ? "" : fmt::format(" that are there, of {}", all))};
  preview.said += readable_bytes(preview.bytes.size());
  if (!drops) {
    preview.warnings.push_back(fmt::format("lamina: {}/{}; the geometry of layers is drawn without their drops", request.source,
                                           drops.error().message));
  }
  if (!view::picture::have_font()) preview.warnings.push_back("lamina: no captions: no font; install fonts-dejavu-core");
  return preview;
}

}  // namespace

Result<Preview> draw_preview(const PreviewRequest& request) {
  const std::string ending = std::filesystem::path(request.output).extension().string();
  std::error_code ignored;
  const bool toolpaths = is_file(request.source) && !is_container(request.source);
  if (!toolpaths && (request.gcode.filament_mm > 0 || request.gcode.layer_height_mm > 0)) {
    return Error{Fault::kUsage, "--filament, --layer-height: are for G-code files; leave them out"};
  }
  if ((ending == ".png" || ending == ".svg") &&
      (toolpaths || product_of_manifest(request.source + "/manifest.json") == Product::kContours)) {
    const auto series = toolpaths ? gcode_series(request.source, request.gcode) : slice_series(request.source);
    if (!series) return series.error();
    auto preview = draw_series(*series, request, ending == ".svg");
    if (preview) preview->warnings.insert(preview->warnings.end(), series->notes.begin(), series->notes.end());
    return preview;
  }
  if (ending != ".png") {
    if (!std::filesystem::exists(request.source, ignored)) return manifest_of(request.source).error();
    return Error{Fault::kUsage,
                 fmt::format("-o {}: pictures are PNG, of slices and G-code SVG too; end the name with .png", request.output)};
  }
  const Result<Manifest> manifest = manifest_of(request.source);
  if (!manifest) return manifest.error();
  if (manifest->layers.empty()) return Error{Fault::kVerification, request.source + ": the manifest has no layers yet"};
  if (manifest->head.extension.empty()) {
    return Error{Fault::kVerification,
                 fmt::format("{}: the job wrote no images (format {}); plan it with another format, as tiff-g4", request.source,
                             manifest->head.format)};
  }
  return request.swath ? draw_jetting(*manifest, request) : draw_images(*manifest, request);
}

}  // namespace lamina::pipeline
