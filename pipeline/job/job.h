// pipeline/job/job.h: what is asked for, as plain values; what follows from it is decided by resolve() (plan/plan.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/job/fill.h"
#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/heights/settings.h"
#include "stages/segment/settings.h"
#include "stages/text/changes.h"

namespace lamina::pipeline {

/// Another material from a height to the next, in mm above the bottom of a part. Where ranges overlap, the last one counts.
struct MaterialRange {
  double from_mm = 0, to_mm = 0;
  std::string material;
};

/// One [[part]] of a job.
struct PartRequest {
  std::string path;
  std::string named_at = {};  // where a job file names it, "job.toml:12:8"; empty if none does
  std::string unit = "mm";    // mm, cm, m, um, inch, foot: of STL and OBJ, which carry none
  std::uint32_t copies = 1;
  std::optional<std::array<double, 2>> at_mm = {};  // where the part's box starts on the bed; arranged if absent
  double bottom_mm = 0;                             // height of the part's lowest point above the bed
  std::array<double, 3> scale{1, 1, 1};
  std::array<double, 3> rotate_deg{0, 0, 0};
  std::array<double, 3> shrink{1, 1, 1};            // compensation factors per axis of the bed, applied last
  FillChanges fill = {};                            // keys of the job's filling that differ
  std::string material = {};                        // name of its powder; no part or every part has one
  std::vector<MaterialRange> material_ranges = {};  // others between two heights above its bottom
};

enum class Engine { kRays, kContours, kBoth };
enum class Mirror { kNone, kX, kY, kXY };

/// Of jobs that name no machine.
inline constexpr std::array<double, 2> kBareBedMm{490, 380};
inline constexpr std::array<std::int64_t, 2> kBareDpi{1200, 1200};

/// Section [heights].
using HeightsRequest = heights::Settings;

/// Section [slice]: contours and the files they go to.
struct SliceRequest {
  std::string format = "svg";      // svg, cli, cli-binary, 3mf
  bool file_a_layer = false;       // layers/000000.svg ... in place of one file
  bool empty_first_layer = false;  // CLI
  double tolerance_um = 0;         // points may be dropped if the contour moves by no more
  double bridge_mm = 0.1;          // longest gap of an open mesh that is closed by a straight stretch
  double offset_mm = 0;            // contours are moved outwards by this; inwards if negative
};

/// The keys of one segmentation.
using SegmentSettings = segment::Settings;

/// Section [segment].
struct SegmentRequest {
  SegmentSettings all;
  std::vector<Range<SegmentSettings>> ranges;  // none overlaps another
  /// Whether any layer may be segmented.
  bool any() const { return all.on || !ranges.empty(); }
};

/// Section [extrude]: what a job changes of its machine, and where material goes to.
struct ExtrudeRequest {
  std::optional<double> flow, nozzle_degc, bed_degc, print_mm_s, wall_mm_s, first_layer_mm_s, travel_mm_s, retraction_mm,
      fan_percent;
  std::optional<bool> relative_extrusion;
  std::vector<std::pair<std::string, std::string>> machine;  // any other key of its profile and the value: fan.from_layer, 2
};

/// [machine] of a job.
struct MachineRequest {
  std::string profile;                                // a shipped one's name, or a file; empty: none
  std::optional<double> scan_speed_mm_s;              // instead of the profile's
  std::optional<std::vector<std::uint32_t>> blocked;  // instead of the profile's
};

/// [dose] of a job: how much binder goes where (stages/dose/).
struct DoseRequest {
  std::array<double, 2> bleed_um{0, 0};                   // along x and y: pixels nearer to the edge than this are left out
  double shell_mm = 0;                                    // so deep all pixels are set; only with a core below 1 or beads
  double core = 1;                                        // share of the pixels inside of the shell that is set
  raster::BeadEnds bead_ends = raster::BeadEnds::kRound;  // of beads that fill a part, and where thick becomes thin
};

/// Everything that decides the bytes of the output, then everything that does not.
struct Job {
  std::vector<PartRequest> parts;
  std::optional<std::array<double, 2>> bed_mm;     // absent: that of the machine; without one kBareBedMm
  std::optional<std::array<std::int64_t, 2>> dpi;  // absent: that of the machine; without one kBareDpi
  double layer_mm = 0.05;
  HeightsRequest heights;
  double gap_mm = 5;  // between parts that are arranged by the planner
  FillRule fill_rule = FillRule::kNonzero;
  Mirror mirror = Mirror::kNone;
  std::string format = "tiff-g4";
  SliceRequest slice;
  FillRequest fill;
  SegmentRequest segment;
  ExtrudeRequest extrude;
  bool repair = true;
  bool drop_bad = false;
  double weld_um = 5;
  MachineRequest machine;
  DoseRequest dose;

  // --- no effect on the bytes of any layer
  std::string output;  // directory
  Engine engine = Engine::kRays;
  std::uint32_t threads = 0;                           // 0: all that the machine has
  std::uint64_t memory_bytes = 1ull << 30;             // what layers in flight may hold
  std::optional<std::array<std::uint32_t, 2>> layers;  // [first, last) only
  std::optional<std::array<std::uint32_t, 2>> shard;   // i of n, i from 0
  bool resume = false;
  bool overwrite = false;  // allow a directory that holds another job's output
  bool dry_run = false;
  bool json = false;
  bool quiet = false;
  std::vector<std::string> notes;  // of reading it, for people: old forms, and what to write now
};

/// Whether every value of a job is within what can be planned, and agrees with the others; for jobs from anywhere.
/// errors  kUsage, one line that begins with the key
Status check_job(const Job& job);

/// Gives the parts of a job their materials: "steel" to all, or "steel,bronze" one to each in their order.
/// errors  kUsage: another number of names, or one that is none
Status set_materials(std::string_view names, Job& job);

/// Whether any layer of any part gets walls, a filling or segmented lines.
bool fills(const Job& job);

/// Why jobs of one file refuse run.shard.
inline constexpr std::string_view kNoShards =
    "shards are of images, which lamina merge joins; a file of all layers is one, some of them are --layers A:B";

/// The layers [first, last) that a job plans of all that its parts need: all, job.layers, or its shard. Shards are
/// the equal shares floor(count * i / n); an end of job.layers beyond the last layer is the last layer.
/// errors  kUsage if job.layers begins beyond the last layer
Result<std::array<std::uint32_t, 2>> layer_range(const Job& job, std::uint32_t layer_count);

}  // namespace lamina::pipeline
