#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <filesystem>
#include <mutex>
#include <optional>

#include "pipeline/cli/command.h"
#include "stages/data/input/file_reader.h"
#include "stages/data/text/json.h"
#include "stages/data/text/readable.h"
#include "stages/data/text/value.h"
#include "stages/raster/mirror.h"
#include "stages/read/layer_images.h"
#include "stages/write/file.h"
#include "stages/write/image_format.h"
#include "stages/write/temporary.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

CommandSpec convert_spec() {
  CommandSpec spec;
  spec.summary =
      "Writes layer images in another format, without a job: a folder of numbered images, a TIFF of several pages, or one\n"
      "image; 1 bit, or grey of 8 or 16 bits. Files are written side by side, one layer each in memory.";
  spec.operand = "STACK";
  spec.operand_meaning = "a folder of images .tif, .png, .bmp, .pbm, .pgm, or one file";
  spec.options = {{"-o,--output", "DIR", "directory for the images", "", "Output"},
                  {"--format", "FORMAT", "of the files", "tiff-g4", "Output"},
                  {"--threshold", "N", "grey below it becomes a set pixel, 1 to 255", "128", "Images"},
                  {"--dpi", "DPI|XxY", "to write, if the images do not tell it", "", "Images"},
                  {"--invert", "", "bright pixels are set, not dark ones", "", "Images"},
                  {"--mirror", "AXES", "turn the images over: x, y or xy", "", "Images"},
                  {"--missing-empty", "", "missing numbers are empty images", "", "Images"},
                  {"--threads", "N", "at most so many; 0: all of the host", "0", "Run"},
                  {"--overwrite", "", "replace images that are there", "", "Run"},
                  {"--json", "", "print the summary as one JSON object on stdout", "", "Run"},
                  {"--quiet", "", "say nothing but errors", "", "Run"}};
  spec.closing =
      "Examples:\n"
      "  lamina convert slices -o g4                              G4, as lamina jet writes it\n"
      "  lamina convert scan.tif -o bits --threshold 90 --invert   a page each, bright is solid\n"
      "  lamina convert out/layers -o bmp --format bmp --mirror x\n";
  return spec;
}

struct Conversion {
  const read::LayerImages& images;
  const write::ImageFormat& format;
  std::array<double, 2> dpi;
  std::string output, mirror;
  std::uint64_t first_number;
  bool overwrite;

  std::string name(std::uint32_t layer) const {
    return fmt::format("{}/{:06}{}", output, first_number + layer, format.extension);
  }
};

struct Converted {
  std::uint64_t bytes = 0, set = 0;
};

/// One layer, read, turned and written.
Status convert_one(const Conversion& all, std::uint32_t layer, Converted& done) {
  auto runs = all.images.read(layer);
  if (!runs) return runs.error();
  if (!all.mirror.empty()) {
    Runs turned;
    raster::mirror(*runs, all.mirror != "y", all.mirror != "x", turned);
    *runs = std::move(turned);
  }
  write::Bytes file;
  const auto encoder = all.format.make_encoder();
  if (Status status = encoder->encode(*runs, all.dpi[0], all.dpi[1], file); !status)
    return Error{status.error().fault, fmt::format("image {}: {}", layer, status.error().message)};
  done.bytes = file.size();
  done.set = set_pixels(*runs);
  return write::write_file(all.name(layer), file, {.lock = false, .follow = false, .durable = write::Durable::kNo});
}

/// errors  kUsage: what is there would be replaced
Status check_place(const Conversion& all, const std::string& stack) {
  std::error_code error;
  const fs::path in = fs::weakly_canonical(stack, error), out = fs::weakly_canonical(all.output, error);
  if (out == in || (fs::is_regular_file(in, error) && in.parent_path() == out))
    return Error{Fault::kUsage, fmt::format("-o {}: is where the images are; name another directory", all.output)};
  if (fs::exists(all.output, error) && !fs::is_directory(all.output, error))
    return Error{Fault::kOutput, fmt::format("-o {}: is a file, not a directory; name another one", all.output)};
  for (std::uint32_t l = 0; !all.overwrite && l < all.images.layers(); ++l) {
    if (fs::exists(fs::symlink_status(all.name(l), error)))
      return Error{Fault::kUsage,
                   fmt::format("{}: is there already; replace it with --overwrite, or name another directory", all.name(l))};
  }
  fs::create_directories(all.output, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", all.output, error.message())};
  return {};
}

/// errors  of the lowest image that fails
Status convert_all(const Conversion& all, const std::atomic<bool>& cancel, Converted& sum) {
  std::mutex mutex;
  std::optional<std::pair<std::uint32_t, Error>> wrong;
  tbb::parallel_for(std::uint32_t{0}, all.images.layers(), [&](std::uint32_t layer) {
    if (cancel) return;
    {
      const std::scoped_lock lock(mutex);
      if (wrong && wrong->first < layer) return;
    }
    Converted done;
    const Status status = convert_one(all, layer, done);
    const std::scoped_lock lock(mutex);
    sum.bytes += done.bytes;
    sum.set += done.set;
    if (!status && (!wrong || layer < wrong->first)) wrong.emplace(layer, status.error());
  });
  if (wrong) return wrong->second;
  if (cancel) return Error{Fault::kInterrupted, "interrupted; images that are written stay, --overwrite writes them again"};
  return {};
}

Result<read::LayerImagesRequest> request_of(const Arguments& arguments) {
  read::LayerImagesRequest request;
  request.invert = arguments.has("--invert");
  request.missing_empty = arguments.has("--missing-empty");
  std::int64_t threshold = 128;
  if (arguments.has("--threshold")) {
    if (const std::string why = read_whole(arguments.text("--threshold"), 1, 255, threshold); !why.empty())
      return Error{Fault::kUsage, "--threshold: " + why};
  }
  request.threshold = static_cast<int>(threshold);
  return request;
}

Outcome run_convert(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1) return Error{Fault::kUsage, "name one stack: a folder of images, or a file"};
  const std::string& stack = arguments.operands.front();
  const std::string output = arguments.text("-o,--output"), mirror = arguments.text("--mirror");
  if (output.empty()) return Error{Fault::kUsage, "-o DIR is missing; name a directory for the images"};
  const std::string id = arguments.has("--format") ? arguments.text("--format") : "tiff-g4";
  const write::ImageFormat* format = write::find_image_format(id);
  if (format == nullptr || format->extension.empty())
    return Error{Fault::kUsage, fmt::format("--format {}: is none of the image formats; `lamina jet --help` lists them", id)};
  if (!mirror.empty() && mirror != "x" && mirror != "y" && mirror != "xy")
    return Error{Fault::kUsage, fmt::format("--mirror {}: give x, y or xy", mirror)};
  const auto request = request_of(arguments);
  if (!request) return request.error();
  std::array<std::int64_t, 2> given{0, 0};
  if (arguments.has("--dpi")) {
    if (const std::string why = read_value(arguments.text("--dpi"), {1, 25'400, "", true}, given); !why.empty())
      return Error{Fault::kUsage, "--dpi: " + why};
  }
  std::int64_t threads = 0;
  if (arguments.has("--threads")) {
    if (const std::string why = read_whole(arguments.text("--threads"), 0, 4096, threads); !why.empty())
      return Error{Fault::kUsage, "--threads: " + why};
  }
  std::optional<tbb::global_control> limit;
  if (threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  const auto images = read::LayerImages::open(stack, *request);
  if (!images) return images.error();
  std::array<double, 2> dpi{images->dpi_x(), images->dpi_y()};
  if (given[0] > 0) dpi = {static_cast<double>(given[0]), static_cast<double>(given[1])};
  if (!(dpi[0] > 0) || !(dpi[1] > 0))
    return Error{Fault::kInput, fmt::format("{}: its files tell no resolution; give --dpi", stack)};
  for (double& one : dpi) {
    if (std::abs(one - std::round(one)) < 0.02) one = std::round(one);  // of whole pixels a metre
  }
  const Conversion all{*images, *format, dpi, output, mirror, images->first_number(), arguments.has("--overwrite")};
  if (Status status = check_place(all, stack); !status) return status;
  const auto claim = write::Claim::take(output + "/manifest.json", output);
  if (!claim) return claim.error();
  Converted sum;
  context.progress({ProgressEvent::Stage::kLayers, 0, images->layers()});
  if (Status status = convert_all(all, context.cancel(), sum); !status) return status;
  context.progress({ProgressEvent::Stage::kLayers, images->layers(), images->layers()});
  if (!arguments.has("--quiet")) {
    context.say(fmt::format("{} images of {} x {} pixels, {} set, {} in {}", images->layers(), images->columns(),
                            images->rows(), readable_count(sum.set), readable_bytes(sum.bytes), output));
  }
  if (arguments.has("--json")) {
    return context.give(Json{{"command", "convert"},
                             {"output", output},
                             {"format", id},
                             {"images", images->layers()},
                             {"columns", images->columns()},
                             {"rows", images->rows()},
                             {"dpi", dpi},
                             {"missing", images->missing()},
                             {"set_pixels", sum.set},
                             {"bytes_written", sum.bytes}});
  }
  return {};
}

}  // namespace

const Command convert_command = {"convert", "layer images to layer images of another format", convert_spec, run_convert};

}  // namespace lamina::pipeline
