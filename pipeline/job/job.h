// pipeline/job/job.h: what was asked for. A job is fully resolved before work starts, and is what the manifest records.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/extrude.h"
#include "pipeline/job/fill.h"
#include "pipeline/job/heights.h"
#include "pipeline/job/machine.h"
#include "pipeline/job/material.h"
#include "pipeline/job/slice.h"
#include "stages/data/fill_rule.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/data/units.h"

namespace lamina::pipeline {

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

/// Everything that decides the bytes of the output, then everything that does not.
struct Job {
  std::vector<PartRequest> parts;
  std::array<double, 2> bed_mm{490, 380};
  std::array<std::int64_t, 2> dpi{1200, 1200};
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

/// The pixels of a job's bed: of its machine, once that is resolved. Only for a checked job.
PixelGrid grid_of(const Job& job);

/// Whether every value of a job is within what can be planned, and agrees with the others; for jobs from anywhere.
/// errors  kUsage, one line that begins with the key
Status check_job(const Job& job);

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
