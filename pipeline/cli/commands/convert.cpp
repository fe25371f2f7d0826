#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <filesystem>
#include <mutex>
#include <optional>

#include "pipeline/cli/command.h"
#include "pipeline/job/errors.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/manifest/manifest.h"
#include "stages/data/bit_image.h"
#include "stages/dose/shares.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/layer_images.h"
#include "stages/raster/images.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/temporary.h"
#include "stages/support/memory_gate.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

CommandSpec convert_spec() {
  CommandSpec spec;
  spec.summary =
      "Converts layer images to another format, without a job. The input is a folder of numbered images, a multi-page TIFF\n"
      "or one image, with 1, 4, 8 or 16 bits.";
  spec.operand = "STACK";
  spec.operand_meaning = "a folder of images (.tif, .png, .bmp, .pbm, .pgm), or one file";
  spec.options = {{"-o,--output", "DIR", "output directory for images", "", "Output"},
                  {"--format", "FORMAT", "file format of layer images", "tiff-g4", "Output"},
                  {"--levels", "N", "grey levels of the output: 2, 4, 16, or 256 with 8 bits", "all of the format", "Output"},
                  {"--threshold", "N", "1-bit formats: pixels with a grey below N are set, 1 to 255", "128", "Images"},
                  {"--dpi", "DPI|XxY", "resolution in pixels per inch, if the images state none", "", "Images"},
                  {"--invert", "", "set bright pixels instead of dark ones", "", "Images"},
                  {"--mirror", "AXES", "mirror images: x swaps left and right, y front and back", "", "Images"},
                  {"--missing-empty", "", "treat missing numbers as empty images", "", "Images"},
                  {"--threads", "N", "number of threads; 0: all processors", "0", "Run"},
                  {"--memory", "SIZE", "memory limit for images in flight: 256M, 1G", "1G", "Run"},
                  {"--overwrite", "", "replace existing images", "", "Run"},
                  {"--json", "", "print the result as one JSON object on stdout", "", "Run"},
                  {"--quiet", "", "print errors only", "", "Run"}};
  spec.closing =
      "Examples:\n"
      "  lamina convert slices -o g4                              G4, as lamina jet writes it\n"
      "  lamina convert scan.tif -o bits --threshold 90 --invert   a page each, bright is solid\n"
      "  lamina convert out/layers -o bmp --format bmp --mirror x\n"
      "  lamina convert grey -o fractions --format tiff-4           fill fractions of voxels, 16 levels\n";
  return spec;
}

struct Conversion {
  formats::LayerImages images;
  const formats::ImageFormat* bits;  // one of both
  const formats::LevelFormat* grey;
  std::uint8_t full;  // the highest level of grey
  std::array<double, 2> dpi;
  std::string output, mirror;
  std::uint64_t first_number;
  bool overwrite;
  std::uint64_t memory = std::uint64_t{1} << 30;

  bool turns(char axis) const { return mirror.find(axis) != std::string::npos; }
  /// Memory of a layer: its pixels, and its file as it is read and written.
  std::uint64_t bytes_of(std::uint32_t layer) const {
    const std::uint64_t changes = images.expected_changes(layer);
    const auto max_bytes = grey != nullptr ? grey->max_bytes : bits->max_bytes;
    const std::uint64_t pixels = grey != nullptr ? 9 * changes : images.expected_bytes(layer);
    return pixels + images.file_bytes(layer) + max_bytes(images.columns(), images.rows(), changes);
  }
  std::string name(std::uint32_t layer) const {
    return fmt::format("{}/{:06}{}", output, first_number + layer, grey != nullptr ? grey->extension : bits->extension);
  }
};

struct Converted {
  std::uint64_t bytes = 0, set = 0;
};

/// One layer, read, turned and coded.
Status code_bits(const Conversion& all, std::uint32_t layer, formats::Bytes& file, Converted& done) {
  auto image = all.images.read(layer, Keep::kSmaller);
  if (!image) return image.error();
  if (image->bits) {
    raster::mirror(*image->bits, all.turns('x'), all.turns('y'));
  } else if (!all.mirror.empty()) {
    Runs turned;
    raster::mirror(image->runs, all.turns('x'), all.turns('y'), turned);
    image->runs = std::move(turned);
  }
  done.set = image->set();
  const auto encoder = all.bits->make_encoder();
  if (image->bits) return encoder->encode(*image->bits, all.dpi[0], all.dpi[1], file);
  return encoder->encode(image->runs.view(), all.dpi[0], all.dpi[1], file);
}

Status code_grey(const Conversion& all, std::uint32_t layer, formats::Bytes& file, Converted& done) {
  Levels levels;
  auto image = all.images.levels(layer, all.full, levels, Keep::kSmaller);
  if (!image) return image.error();
  const auto encoder = all.grey->make_encoder();
  if (image->bits) {
    raster::mirror(*image->bits, all.turns('x'), all.turns('y'));
    done.set = image->bits->set_pixels();
    return encoder->encode(*image->bits, all.dpi[0], all.dpi[1], file);
  }
  if (!all.mirror.empty()) {
    Levels turned;
    dose::mirror(levels, all.turns('x'), all.turns('y'), turned);
    levels = std::move(turned);
  }
  done.set = pixels_at(levels);
  return encoder->encode(levels.view(), all.full, all.dpi[0], all.dpi[1], file);
}

Status convert_one(const Conversion& all, std::uint32_t layer, Converted& done) {
  formats::Bytes file;
  const Status status = all.grey != nullptr ? code_grey(all, layer, file, done) : code_bits(all, layer, file, done);
  if (!status && status.error().fault == Fault::kOutput)
    return failure(status.error().fault, "image {}: {}", layer, status.error().message);
  if (!status) return status;
  done.bytes = file.size();
  return write_file(all.name(layer), file, {.lock = false, .follow = false, .durable = Durable::kNo});
}

/// errors  kUsage: what is there would be replaced
Status check_output(const Conversion& all, const std::string& stack) {
  std::error_code error;
  const fs::path in = fs::weakly_canonical(stack, error), out = fs::weakly_canonical(all.output, error);
  if (out == in || (fs::is_regular_file(in, error) && in.parent_path() == out))
    return usage("-o {}: is where the images are; name another directory", all.output);
  if (fs::exists(all.output, error) && !fs::is_directory(all.output, error))
    return failure(Fault::kOutput, "-o {}: is a file, not a directory; name another one", all.output);
  for (std::uint32_t l = 0; !all.overwrite && l < all.images.layers(); ++l) {
    if (fs::exists(fs::symlink_status(all.name(l), error)))
      return usage("{}: is there already; replace it with --overwrite, or name another directory", all.name(l));
  }
  fs::create_directories(all.output, error);
  if (error) return failure(Fault::kOutput, "{}: {}", all.output, error.message());
  return {};
}

/// Holds the output directory and removes what a killed conversion left in it. errors  kOutput: another run writes here
Result<Claim> claim_folder(const std::string& output) {
  auto claim = Claim::take(output + "/manifest.json", output);
  if (!claim) return claim;
  // The files of a running job have no locks of their own.
  std::error_code ignored;
  const fs::path folder = fs::weakly_canonical(output, ignored);
  if (folder.filename() == "layers") {
    for (const ManifestFile& file : find_manifests(folder.parent_path().string())) {
      std::string name = (folder.parent_path() / file.name).string();
      if (file.partial) name.resize(name.size() - part_of("").size());
      if (Status status = check_not_being_written(name); !status) return status.error();
    }
  }
  remove_leftovers(output, [](std::string_view name) {
    std::uint32_t index = 0;
    bool partial = false;
    return read_layer_file_name(name, index, partial);
  });
  return claim;
}

/// errors  of the lowest image that fails
Status convert_all(const Conversion& all, const std::atomic<bool>& cancel, Converted& sum) {
  std::mutex mutex;
  std::optional<std::pair<std::uint32_t, Error>> wrong;
  MemoryGate gate(all.memory);
  tbb::parallel_for(std::uint32_t{0}, all.images.layers(), [&](std::uint32_t layer) {
    const auto pass = gate.enter(all.bytes_of(layer));
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
  if (cancel) return failure(Fault::kInterrupted, "interrupted; images that are written stay, --overwrite writes them again");
  return {};
}

Result<formats::LayerImagesRequest> request_of(const Arguments& arguments) {
  formats::LayerImagesRequest request;
  request.invert = arguments.has("--invert");
  request.missing_empty = arguments.has("--missing-empty");
  std::int64_t threshold = 128;
  if (Status status = arguments.read("--threshold", {1, 255}, threshold); !status) return status.error();
  request.threshold = static_cast<int>(threshold);
  return request;
}

/// The format, and the highest level of a grey one. errors  kUsage
Status choose_format(const Arguments& arguments, const std::string& id, Conversion& all) {
  all.bits = formats::find_image_format(id);
  all.grey = formats::find_level_format(id);
  if (all.grey == nullptr && (all.bits == nullptr || all.bits->extension.empty()))
    return usage("--format: {}", formats::unknown_format(id));
  const bool nibbles = id == "tiff-4";
  all.full = nibbles ? 15 : 255;
  if (all.grey == nullptr && arguments.has("--levels"))
    return at_option("--levels", fmt::format("is of grey formats, and {} has 1 bit; choose tiff-4, tiff-8 or png-8", id));
  if (all.grey != nullptr && arguments.has("--threshold"))
    return at_option("--threshold", fmt::format("is of 1-bit formats, and {} keeps grey; leave it out", id));
  if (!arguments.has("--levels")) return {};
  std::int64_t levels = 0;
  const std::string why = read_whole(arguments.text("--levels"), 2, 256, levels);
  if (!why.empty() || (levels != 2 && levels != 4 && levels != 16 && (levels != 256 || nibbles)))
    return at_option("--levels", nibbles ? "give 2, 4 or 16" : "give 2, 4, 16 or 256");
  all.full = static_cast<std::uint8_t>(levels - 1);
  return {};
}

Outcome run_convert(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1) return usage("name one stack: a folder of images, or a file");
  const std::string& stack = arguments.operands.front();
  const std::string output = arguments.text("-o,--output"), mirror = arguments.text("--mirror");
  if (output.empty()) return usage("-o DIR is missing; name a directory for the images");
  const std::string id = arguments.has("--format") ? arguments.text("--format") : "tiff-g4";
  Conversion all{{}, nullptr, nullptr, 0, {}, output, mirror, 0, arguments.has("--overwrite")};
  if (Status status = choose_format(arguments, id, all); !status) return status;
  if (!mirror.empty() && mirror != "x" && mirror != "y" && mirror != "xy") return usage("--mirror {}: give x, y or xy", mirror);
  const auto request = request_of(arguments);
  if (!request) return request.error();
  std::array<double, 2> given{0, 0};
  std::int64_t threads = 0;
  const Limits resolution{.low = 1, .high = kMaxDpi, .one_for_all = true, .digits = kDpiDigits};
  for (const Status& status : {arguments.read("--dpi", resolution, given), arguments.read("--threads", {0, 4096}, threads),
                               arguments.read("--memory", read_bytes, all.memory)})
    if (!status) return status;
  std::optional<tbb::global_control> limit;
  if (threads > 0) limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  const auto reported = images_on_record(stack);
  if (!reported) return reported.error();
  auto images = formats::LayerImages::open(reported->path, *request);
  if (!images) return images.error();
  std::array<double, 2>& dpi = all.dpi;
  dpi = {formats::requested_dpi(images->dpi_x()), formats::requested_dpi(images->dpi_y())};
  if (given[0] > 0) dpi = given;
  if (!(dpi[0] > 0) || !(dpi[1] > 0)) return failure(Fault::kInput, "{}: its files state no resolution; add --dpi", stack);
  all.first_number = images->first_number();
  all.images = std::move(*images);
  if (Status status = check_output(all, stack); !status) return status;
  const auto claim = claim_folder(output);
  if (!claim) return claim.error();
  Converted sum;
  context.progress({ProgressEvent::Stage::kLayers, 0, all.images.layers()});
  if (Status status = convert_all(all, context.cancel(), sum); !status) return status;
  context.progress({ProgressEvent::Stage::kLayers, all.images.layers(), all.images.layers()});
  if (!arguments.has("--quiet")) {
    context.say(fmt::format("{} images of {} x {} pixels, {} set, {} in {}", all.images.layers(), all.images.columns(),
                            all.images.rows(), readable_count(sum.set), readable_bytes(sum.bytes), output));
    if (reported->geometry)
      context.say(fmt::format("note: images of {} are the geometry before the dose; plan it with --images drops for its drops",
                              one_line(stack)));
  }
  if (arguments.has("--json")) {
    return context.give(Json{{"command", "convert"},
                             {"output", output},
                             {"format", id},
                             {"images", all.images.layers()},
                             {"columns", all.images.columns()},
                             {"rows", all.images.rows()},
                             {"dpi", dpi},
                             {"missing", all.images.missing()},
                             {"set_pixels", sum.set},
                             {"bytes_written", sum.bytes}});
  }
  return {};
}

}  // namespace

const Command convert_command = {"convert", "convert layer images to another format", convert_spec, run_convert};

}  // namespace lamina::pipeline
