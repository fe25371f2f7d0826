// Manifests: finished ones, and what an interrupted run left.
#include "pipeline/manifest/manifest.h"

#include "pipeline/manifest/manifest_text.h"
#include "stages/program/dialect.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

/// The file that a writer makes of a manifest.
std::string text_of(const Manifest& manifest, bool ended) {
  static const PathFacts kNone;
  std::string text = head_text(manifest.head);
  bool first = true;
  for (const LayerRecord& record : manifest.layers) {
    text += std::exchange(first, false) ? "\n" : ",\n";
    LineWriter line(text);
    describe_line(line, manifest.head, record, record.paths ? *record.paths : kNone);
  }
  return ended ? text + tail_text(manifest.head, manifest.file) : text + "\n";
}

Result<Manifest> read(std::string_view text, bool partial) {
  static MemoryFile whole("manifest.json"), part("manifest.json.part");
  return read_manifest((partial ? part : whole).hold(text));
}

bool check(std::string_view text, bool partial) {
  const Result<Manifest> manifest = read(text, partial);
  if (!manifest) return check_error(manifest.error()), false;
  const ManifestHead& head = manifest->head;
  law(head.first_layer <= head.last_layer && head.last_layer <= head.layer_count, "a range beyond the layers");
  law(manifest->layers.size() <= head.last_layer - head.first_layer, "more layers than the range");
  law(manifest->complete == !partial, "complete");
  for (const LayerRecord& record : manifest->layers) {
    for (const LayerImageFile& file : layer_images(head, record)) {
      law(file.name.find("..") == std::string::npos && !file.name.starts_with('/'), "a file outside of the directory");
    }
  }
  const std::string written = text_of(*manifest, !partial);
  const Result<Manifest> again = read(written, partial);
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(text_of(*again, !partial) == written, "a manifest that was written reads back as another one");
  law(again->head.id() == head.id() && difference(again->head, head).empty(), "the id of a manifest has changed");
  return true;
}

bool read_finished(std::string_view text) { return check(text, false); }
bool read_partial(std::string_view text) { return check(text, true); }

ManifestHead some_head(Product product) {
  ManifestHead head;
  head.product = product;
  head.version = "0.1.0";
  head.job_toml = "[bed]\nsize_mm = [60, 40]\n\n[[part]]\npath = \"a.stl\"\n";
  head.format = product == Product::kImages ? "tiff-g4" : product == Product::kContours ? "svg" : "gcode";
  if (product == Product::kImages) head.extension = ".tif";
  if (product == Product::kContours) head.extension = ".svg";
  if (product == Product::kMoves) head.file = "a.gcode";
  head.layer_count = head.last_layer = 3;
  PartSummary part;
  part.path = "a.stl";
  part.triangles = 12;
  part.fingerprint = 0xfedcba9876543210;
  part.bounds = {{0, 0, 0}, {10'000'000, 20'000'000, 300'000}};
  part.notes = {{true, "a hole closed"}};
  head.parts = {part};
  head.fill_rule = "nonzero";
  head.mirror = "none";
  head.grid = {PixelAxis(600, 60'000'000), PixelAxis(300, 40'000'000)};
  return head;
}

std::vector<std::string> seeds_of(bool ended) {
  std::vector<std::string> seeds;
  for (const int kind : {0, 1, 2, 3, 4}) {
    Manifest manifest;
    manifest.head = some_head(kind == 1 ? Product::kContours : kind == 2 ? Product::kMoves : Product::kImages);
    ManifestHead& head = manifest.head;
    if (kind >= 3) {
      head.machine = "nuferbj";
      head.dialect = "nuferbj";
      head.program_extension = program::find_dialect("nuferbj")->extension;
    }
    if (kind == 4) {
      head.materials.resize(2);
      head.materials[0].name = "bronze";
      head.materials[1].name = "sand";
    }
    for (std::uint32_t i = 0; i < 3; ++i) {
      LayerRecord& record = manifest.layers.emplace_back();
      record.layer = {i, static_cast<Nm>(i * 100'000), 100'000, i == 0 ? LayerReason::kUniform : LayerReason::kCusp};
      record.bytes = 1000 + i;
      record.hash = {i * 0x9e3779b97f4a7c15ull, ~std::uint64_t{i}};
      record.images.resize(head.materials.size());
      if (head.product != Product::kImages) record.paths = std::make_shared<PathFacts>();
    }
    seeds.push_back(text_of(manifest, ended));
  }
  return seeds;
}
std::vector<std::string> whole_seeds() { return seeds_of(true); }
std::vector<std::string> partial_seeds() { return seeds_of(false); }

constexpr std::string_view kManifestSources = "pipeline/manifest stages/support/text stages/support/hash stages/data/layer";
const Registered kWhole({"manifest", read_finished, whole_seeds, kManifestSources, "", "manifest.dict", 6000});
const Registered kPartial({"manifest_part", read_partial, partial_seeds, kManifestSources, "", "manifest.dict", 6000});

}  // namespace
}  // namespace lamina::fuzz
