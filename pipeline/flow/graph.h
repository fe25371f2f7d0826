// pipeline/flow/graph.h: how layers move: the flow graph and its memory budget.
//
//      admit ──> raster ──> encode ──> store ──> in order ──> record
//        ^                               │
//        └───── credits in bytes ────────┘
//
// Layers are admitted in order, as long as the bytes that they may need fit into the budget; a layer that alone exceeds
// it runs alone. raster, encode and store run for many layers at once; record sees every layer once, in order, and so
// decides which failure is the first, whatever the threads do.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "pipeline/output/manifest.h"
#include "pipeline/output/print_program.h"
#include "pipeline/plan/porous_plan.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/raster/materials.h"
#include "stages/raster/raster.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {

/// What a layer occupies while it is in flight; reused by later layers, which pay for what it holds on to.
struct LayerWork {
  /// Of its buffers; what an encoder keeps for itself is small.
  std::uint64_t bytes() const {
    std::uint64_t total =
        scratch.bytes() + bytes_held(file) + program.bytes() + materials.bytes() + (porous ? porous->bytes() : 0);
    for (const write::Bytes& one : files) total += bytes_held(one);
    for (const Runs* image : {&runs, &second, &third, &lowest, &highest, &section}) {
      total += bytes_held(image->row_offset) + bytes_held(image->change);
    }
    return total;
  }

  raster::LayerScratch scratch;
  Runs runs;
  Runs second;           // of the other engine, or mirrored, or before its dose
  Runs third;            // the core of a layer with a shell
  Runs lowest, highest;  // sections at both ends of the layer, where steps have to lie inside or outside
  Runs section;          // of one solid of a layer with several materials
  raster::MaterialImages materials;
  std::unique_ptr<PorousWork> porous;  // where beads fill parts
  std::unique_ptr<write::ImageEncoder> encoder;
  write::Bytes file;
  std::vector<write::Bytes> files;  // one for each material, if the job has several
  ProgramWork program;
};

/// What is left of a layer when its file is written.
struct LayerOutcome {
  LayerRecord record;
  raster::LayerReport report;
  std::uint64_t solid_pixels = 0, bead_pixels = 0;  // of parts, and what beads and shells leave of them
  Status status;
};

/// What is done with a layer; each is called once a layer, in this order. The first three from many threads at once,
/// and not after one of them has failed for that layer; `record` from one thread at a time, in layer order.
struct LayerStages {
  std::function<Status(LayerWork&, LayerOutcome&)> raster, encode, store;
  std::function<Status(const LayerOutcome&)> record;  // an error ends the job
};

struct GraphLimits {
  std::uint64_t budget_bytes = 1ull << 30;
  std::uint32_t most_in_flight = 1;                           // layers; bounds the work lost by an interruption
  std::uint32_t most_unrecorded = 256;                        // layers that may be ahead of a slow lower one
  std::function<std::uint64_t(const Layer&)> bytes_of_layer;  // at most; scratch, runs and file
};

struct GraphReport {
  std::uint32_t most_in_flight = 0;
  std::uint64_t most_bytes = 0;  // of credits given out at once
};

/// Runs all layers through the stages.
/// layers  in increasing order
/// cancel  looked at before each admission: layers in flight are finished and recorded, then the error is kInterrupted
/// errors  the first failing layer's (in layer order), or kInterrupted
Status run_layers(std::span<const Layer> layers, const LayerStages& stages, const GraphLimits& limits,
                  const std::atomic<bool>& cancel, GraphReport& report);

}  // namespace lamina::pipeline
