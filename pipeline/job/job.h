// pipeline/job/job.h: a job as requested, in plain values; resolve() (plan/plan.h) derives the rest.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/heights/settings.h"
#include "stages/infill/settings.h"
#include "stages/segment/segmentation.h"
#include "stages/support/text/changes.h"

namespace lamina {
enum class VatRule : std::uint8_t;  // stages/data/machine.h
}
namespace lamina::heights {
struct Options;
}
namespace lamina::load {
class PartStore;
}

namespace lamina::pipeline {

enum class Engine { kRays, kContours, kBoth };
enum class Mirror { kNone, kX, kY, kXY };
/// What layer images have where a dose follows the image of the solids.
enum class ImageContent { kAuto, kGeometry, kDrops };
constexpr bool mirrors_x(Mirror mirror) { return mirror == Mirror::kX || mirror == Mirror::kXY; }
constexpr bool mirrors_y(Mirror mirror) { return mirror == Mirror::kY || mirror == Mirror::kXY; }

/// Defaults of jobs without a machine.
inline constexpr std::array<double, 2> kBareBedMm{490, 380};
inline constexpr std::array<double, 2> kBareDpi{1200, 1200};

/// Section [heights].
using HeightsRequest = heights::Settings;

/// Section [slice]: contours and their files.
struct SliceRequest {
  std::string format = "svg";          // of formats::slice_formats()
  bool file_a_layer = false;           // layers/000000.svg ... in place of one file
  bool empty_first_layer = false;      // CLI
  std::optional<double> tolerance_um;  // simplification: greatest displacement of contours; absent: tolerance_um_of()
  double bridge_mm = 0.1;              // longest gap in an open mesh that a straight segment closes
  double offset_mm = 0;                // offset of the contours, positive outwards
};

/// The keys of one filling.
using FillSettings = infill::FillSettings;
using FillChanges = Changes<FillSettings>;
using FillRange = Range<FillSettings>;

/// Section [fill].
struct FillRequest {
  FillSettings all;
  std::vector<FillRange> ranges;  // none overlaps another
};

/// The keys of one segmentation.
using SegmentSettings = segment::SegmentSettings;

/// Section [segment].
struct SegmentRequest {
  SegmentSettings all;
  std::vector<Range<SegmentSettings>> ranges;  // none overlaps another
  /// Whether any layer may be segmented.
  bool any() const { return all.on || !ranges.empty(); }
};

/// Section [extrude]: changes to the machine, and where material is deposited.
struct ExtrudeRequest {
  std::optional<double> flow, nozzle_degc, bed_degc, print_mm_s, wall_mm_s, first_layer_mm_s, travel_mm_s, retraction_mm,
      fan_percent;
  std::optional<bool> relative_extrusion;
  std::optional<std::uint32_t> skirt_loops;
  // --- of the first layer
  double brim_mm = 0;                                       // width of loops around the parts
  double elephant_foot_mm = 0;                              // by which contours are moved inwards
  std::optional<double> first_thickness_mm, first_bead_mm;  // absent: as in the others
  // --- of layers under the parts; with some, the settings of the first layer are those of the raft's
  std::uint32_t raft_layers = 0;
  double raft_gap_mm = 0.1, raft_margin_mm = 3;              // up to the parts; around them
  std::string material;                                      // name of a material, or a file; empty: the printer's
  std::vector<std::pair<std::string, std::string>> machine;  // other profile keys with values: fan.from_layer, 2
};

/// Section [machine].
struct MachineRequest {
  std::string profile;                                // name of a profile, or a file; empty: none
  std::vector<std::string> presets;                   // of powder, binder and process that change it, in their order
  std::optional<double> scan_speed_mm_s;              // instead of the profile's
  std::optional<std::vector<std::uint32_t>> blocked;  // instead of the profile's
  std::optional<VatRule> vat_rule;                    // instead of the profile's
};

/// Another saturation between two heights above the bed, in mm. Where ranges overlap, the last one counts.
struct SaturationRange {
  double from_mm = 0, to_mm = 0;
  Saturation percent;
  std::optional<Saturation> core_percent;  // inside of the shell; absent: as in it
};

/// Section [dose]: the distribution of binder (stages/dose/).
struct DoseRequest {
  std::array<double, 2> bleed_um{0, 0};  // along x and y: pixels closer to the edge are cleared; negative: are set outside
  std::optional<std::array<double, 2>> hole_bleed_um;   // of the edges of holes; absent: as bleed_um
  std::optional<std::array<double, 2>> first_bleed_um;  // of all edges of the first layers; absent: as in the others
  std::uint32_t first_layers = 1;
  double shell_mm = 0;                                // pixels stay set to this depth; only with a core below 1 or beads
  double core = 1;                                    // fraction of the pixels inside the shell that stay set
  std::optional<Saturation> saturation_percent;       // of the voids; absent: one drop a pixel
  std::optional<Saturation> core_saturation_percent;  // inside of the shell
  std::vector<SaturationRange> saturation_ranges;
  bool dithered = true;                                   // drops that are not whole; else they are rounded
  raster::BeadEnds bead_ends = raster::BeadEnds::kRound;  // of filling beads, also where thick changes to thin
};

/// A different material between two heights, in mm above the bottom of a part. Where ranges overlap, the last one counts.
struct MaterialRange {
  double from_mm = 0, to_mm = 0;
  std::string material;
};

/// The properties of images used as a part (docs/howto/plan_images.md) that their files do not state.
struct PartImages {
  std::optional<std::array<double, 2>> dpi;  // absent: by the tags of the files
  std::optional<double> layer_mm;            // absent: by the manifest next to them, or the job's
  std::uint32_t threshold = 128;             // grey below it is dark, 1 .. 255
  bool invert = false;                       // bright pixels are jetted
  bool missing_empty = false;                // numbers that are missing are empty layers
  bool crop = false;                         // what sticks out of the bed is cut off
  bool resample = false;                     // another dpi than the job's is brought to it
  bool operator==(const PartImages&) const = default;
};

/// One [[part]] of a job.
struct PartRequest {
  std::string path;
  std::string named_at = {};  // position in the job file, "job.toml:12:8"; empty without one
  std::string unit = "mm";    // mm, cm, m, um, inch, foot: for STL and OBJ, which store no unit
  std::uint32_t copies = 1;
  std::optional<std::array<double, 2>> at_mm = {};  // corner of the part's box on the bed; arranged if absent
  std::optional<double> bottom_mm = {};             // height of the part's lowest point above the bed; absent: of images as
                                                    // their manifest has it, else 0
  std::array<double, 3> scale{1, 1, 1};
  std::array<double, 3> rotate_deg{0, 0, 0};
  std::array<double, 3> shrink{1, 1, 1};            // compensation factors per axis of the bed, applied last
  FillChanges fill = {};                            // changes to the job's filling
  std::string material = {};                        // name of its powder; set for all parts or for none
  std::vector<MaterialRange> material_ranges = {};  // other materials between heights above its bottom
  PartImages images = {};                           // of a part that is images
  // --- instead of the job's
  std::optional<std::array<double, 2>> bleed_um = {}, hole_bleed_um = {};
  std::optional<Saturation> saturation_percent = {}, core_saturation_percent = {};  // at all heights; by its own corner
};

/// First the fields that decide the bytes of the output, then the others.
struct Job {
  std::vector<PartRequest> parts;
  std::optional<std::array<double, 2>> bed_mm;  // absent: the machine's bed, or kBareBedMm without a machine
  std::optional<double> margin_mm;              // absent: the machine's margin of the bed, or none
  std::optional<std::array<double, 2>> dpi;     // absent: the machine's dpi, or kBareDpi without a machine
  double layer_mm = 0.05;
  HeightsRequest heights;
  double gap_mm = 5;  // between automatically arranged parts
  FillRule fill_rule = FillRule::kNonzero;
  Mirror mirror = Mirror::kNone;
  std::uint32_t levels = 0;  // of shares of voxels, 2, 4 or 16; 0: pixels are set or not
  std::string format = "tiff-g4";
  ImageContent image_content = ImageContent::kAuto;  // kAuto: geometry where drops follow from it, the job and the machine
  std::string title;                                 // of the job, in tags of its images
  SliceRequest slice;
  FillRequest fill;
  SegmentRequest segment;
  ExtrudeRequest extrude;
  bool repair = true;
  bool winding = false;  // close open meshes by their winding number; only with repair
  bool drop_bad = false;
  double weld_um = 5;
  MachineRequest machine;
  bool compress_programs = true;  // of dialects that are lamina's own
  DoseRequest dose;

  // --- no effect on the bytes of any layer
  std::string output;  // directory
  Engine engine = Engine::kRays;
  Isa isa = Isa::kAuto;                                // widest instructions of the kernels
  std::uint32_t threads = 0;                           // 0: all of the host
  std::uint64_t memory_bytes = 1ull << 30;             // budget of the layers in flight
  Sync sync = Sync::kJob;                              // what survives a power cut
  Container container = Container::kNone;              // of images; of kZip, output is the name of its file
  std::optional<std::array<std::uint32_t, 2>> layers;  // [first, last) only
  std::optional<std::array<std::uint32_t, 2>> shard;   // i of n, i from 0
  bool resume = false;
  bool overwrite = false;  // allow a directory with another job's output
  bool dry_run = false;
  bool strict = false;                 // warnings are errors
  bool inspect = false;                // detect islands, hollows and thin walls in the layers
  std::optional<double> min_wall_mm;   // what is narrower is thin; absent: two pixels, or a drop
  std::optional<double> min_drain_mm;  // powder does not leave through less; absent: 0.8
  double support_angle_deg = 45;       // faces that are flatter hang; 0: vertical walls, 90: horizontal faces
  bool allow_empty = false;            // a whole job may have nothing
  bool allow_unbound = false;          // layers may get less binder than the machine's powder needs
  bool timing = false;                 // break down the run time
  bool quote = false;                  // report the consumption of each part, also without prices
  bool json = false;
  bool quiet = false;
  std::vector<std::string> named;           // keys that a file, an option or --set gave, as in "fill.walls"
  std::shared_ptr<load::PartStore> loaded;  // parts of the jobs of one process; none: each job reads its files
  bool leave_to_machine = false;            // toolpaths: unset walls and layers are the extruder's, not those here
  /// Profiles that its file names and that are not there, with what to say of each.
  std::vector<std::pair<std::string, std::string>> missing;
};

/// Checks every value of a job against its limits and against the others; for jobs from any source.
/// errors  kUsage, one line that begins with the key
Status check_job(const Job& job);

/// Whether the name of a file ends in .zip.
bool names_container(std::string_view path);

/// The name of a job's output: with a ZIP container, DIR becomes DIR.zip. Names of no file stay: `-`, a device, `.` and `..`.
std::string output_of(std::string output, Container container);

/// Section [heights] as checked options of the stage. errors  kUsage, one line that begins with the key
Result<heights::Options> heights_options(const Job& job);

/// The job's slice.tolerance_um; if absent 10 for toolpaths, whose planners plan ahead over a few dozen moves, else 0.
double tolerance_um_of(const Job& job, Product product);

/// Sets the changed keys. A changed distance between lines replaces every earlier setting of that distance.
void apply(const FillChanges& changes, FillSettings& settings);

/// Sets the distances between lines in `changes`.
void set_distances(const std::vector<double>& distance_mm, FillChanges& changes);

/// Whether these settings produce walls or a filling in any layer.
bool fills(const FillSettings& settings);

/// The keys for the distance between lines whose values differ from their defaults; at most one of distance_mm,
/// gap_formula, gap_by_height and gap_mm is valid.
std::vector<std::string_view> distance_keys(const FillSettings& settings);
/// The same for changes: every key that is set, to any value.
std::vector<std::string_view> distance_keys(const FillChanges& changes);
/// Whether changes set a key, and whether they set how lines are spaced other than by a density.
bool names_key(const FillChanges& changes, std::string_view name);
bool names_spacing(const FillChanges& changes);

/// Sets the materials of the parts: "steel" for all, or "steel,bronze" one per part in order.
/// errors  kUsage: wrong number of names, or an invalid name
Status set_materials(std::string_view names, Job& job);

/// Every bleed that a job or a part of it states.
std::vector<std::array<double, 2>> bleeds_of(const Job& job);

/// Whether any layer of any part has walls, a filling or segmented lines.
bool fills(const Job& job);

/// Whether drops of a job with a machine follow from the image of a layer before the dose: one material, one dose that is no
/// formula, no levels.
bool drops_follow_image(const Job& job);

/// Whether pixels of an image can differ from those of its parts' sections on purpose, but for bleed.
bool thins(const Job& job);

/// Why jobs of one file refuse run.shard.
inline constexpr std::string_view kNoShards =
    "shards are of images, which lamina merge joins; a file of all layers is one, some of them are --layers A:B";

/// The layers [first, last) of this run, out of all layers of the parts: all, job.layers, or its shard. Shards start at
/// floor(count * i / n); an end of job.layers beyond the last layer is clamped to it.
/// errors  kUsage if job.layers begins beyond the last layer
Result<std::array<std::uint32_t, 2>> layer_range(const Job& job, std::uint32_t layer_count);

}  // namespace lamina::pipeline
