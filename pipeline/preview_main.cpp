// pipeline/preview_main.cpp: the program lamina-preview, which `lamina preview` hands over to.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/output/manifest.h"
#include "pipeline/show/gcode_picture.h"
#include "pipeline/show/preview_layers.h"
#include "pipeline/show/preview_swath.h"
#include "pipeline/show/slice_picture.h"
#include "pipeline/text/readable.h"
#include "stages/read/image.h"
#include "stages/write/file.h"
#include "stages/write/picture/canvas.h"  // have_font
#include "stages/write/picture/contact_sheet.h"
#include "stages/write/picture/drawing.h"

namespace lamina::pipeline {
namespace {

Result<Manifest> manifest_of(const std::string& directory) {
  std::error_code ignored;
  const std::string whole = directory + "/manifest.json", part = whole + ".part";
  if (!std::filesystem::exists(whole, ignored) && std::filesystem::exists(part, ignored)) return read_manifest(part);
  if (!std::filesystem::exists(directory, ignored)) {
    return Error{Fault::kUsage, fmt::format("{}: no such directory or file", directory)};
  }
  if (!std::filesystem::exists(whole, ignored)) {
    return Error{Fault::kVerification,
                 fmt::format("{}: no manifest.json; name a directory that lamina jet or lamina slice wrote (shards: run "
                             "lamina merge first)",
                             directory)};
  }
  return read_manifest(whole);
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
  const Result<Arguments> arguments = read_arguments(spec_of(preview_command), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) {
    const Status status = print(*arguments->help);
    return status ? 0 : fail(status.error());
  }
  // Of a drawing the outputs are those of the command that left it.
  if (arguments->has("--drawing")) return run_drawing(arguments->text("--drawing"), arguments->text("-o,--output"));
  if (Status status = check_outputs("preview", *arguments); !status) return fail(status.error());
  if (arguments->operands.size() != 1) {
    return fail({Fault::kUsage, "name one directory that lamina jet or lamina slice wrote, or one G-code file"});
  }
  const std::string directory = arguments->operands.front(), output = arguments->text("-o,--output");
  if (output.empty()) return fail({Fault::kUsage, "-o PNG is missing; name the picture"});
  const auto width = whole_number(*arguments, "--width", 200, 20'000);
  if (!width) return fail(width.error());
  const std::string extension = std::filesystem::path(output).extension();
  const bool drawing = extension == ".png" || extension == ".svg";
  std::error_code ignored;
  const bool toolpaths = std::filesystem::is_regular_file(directory, ignored);
  if (drawing && (toolpaths || is_slice_directory(directory))) {
    const auto series = toolpaths ? gcode_series(directory) : slice_series(directory);
    return series ? preview_series(*series, output, *arguments, (*width).value_or(2400)) : fail(series.error());
  }
  if (extension != ".png") {
    return fail(
        {Fault::kUsage, fmt::format("-o {}: pictures are PNG, of slices and G-code SVG too; end the name with .png", output)});
  }
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
    const auto layer = whole_number(*arguments, "--layer", 0, UINT32_MAX),
               step = whole_number(*arguments, "--step", 0, UINT32_MAX);
    const bool middle = arguments->text("--swath") == "middle";
    const auto swath =
        middle ? Result<std::optional<std::uint32_t>>(std::nullopt) : whole_number(*arguments, "--swath", 0, UINT32_MAX);
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
  const auto read = [](const std::string& path) -> Result<Runs> {
    auto image = read::image(path);
    if (!image) return image.error();
    return std::move(image->runs);
  };
  const Result<Buffer<std::byte>> picture = write::picture::contact_sheet(request, read);
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
