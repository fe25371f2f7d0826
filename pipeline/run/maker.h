// pipeline/run/maker.h: makes the layers of one product and writes them to its files.
//
// A new product is a Maker; a new kind of file is a sink in pipeline/output/. run() moves layers through a maker's
// steps: sequentially within a layer, concurrently across layers.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "pipeline/flow/layers.h"
#include "pipeline/manifest/record.h"
#include "pipeline/report/summary.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A Step of the flow with the layer's index in the job instead of its position in the flow.
struct MakerStep {
  std::string_view name;
  std::function<Status(std::uint32_t layer, const Ticket&)> run;
  std::function<Result<std::uint64_t>(std::uint32_t layer, const Ticket&)> needs = {};
};

/// The name of steps that write files.
inline constexpr std::string_view kStoreStep = "store";

class Maker {
 public:
  virtual ~Maker() = default;

  /// First estimate of a layer's bytes: scratch, text and files.
  virtual std::uint64_t bytes_of(std::uint32_t layer) const = 0;

  // --- files: once, before the first layer
  /// Starts the files. returns  the layers still to be made, in increasing order
  /// errors  kUsage: existing output of another job; kOutput
  virtual Result<std::vector<std::uint32_t>> open() = 0;
  /// Starts what states the number of layers, of a plan whose layers are decided since open(). errors  kOutput
  virtual Status start() { return {}; }
  /// Whether a dry run makes the layers too, for what they take; then open() and all below write nothing.
  virtual bool times_dry_runs() const { return false; }
  /// Records of the layers kept from an interrupted run.
  virtual std::vector<LayerRecord> kept() const = 0;

  // --- layers
  virtual std::vector<MakerStep> steps() = 0;
  virtual bool records_from_work() const = 0;
  /// Adds a layer to the files and to the summary; called in layer order, one at a time.
  virtual Status record(std::uint32_t layer, const Ticket& ticket) = 0;
  /// Adds a kept layer.
  virtual void add_kept(const LayerRecord& record) = 0;
  virtual std::uint64_t bytes_held(std::uint32_t work) const = 0;
  virtual void let_go(std::uint32_t work) = 0;
  /// Of what record() keeps from layer to layer.
  virtual std::uint64_t extra_bytes() const { return 0; }

  // --- the end
  /// Adds the product's own warnings; before finish().
  virtual void warn(const Summary& so_far, std::vector<Warning>& warnings) const = 0;
  /// Closes the files. returns  total bytes written
  virtual Status finish() = 0;
  /// Whether --resume can resume from finished layers.
  virtual bool keeps() const { return true; }
  /// Ends recording early. keep  true: finished layers stay for a resumed run; false: started files are removed
  virtual Status stop(bool keep) = 0;
  /// Removes all files of the job, finished layers too.
  virtual void discard() = 0;
  /// Crossings of rows with surfaces in all layers made; 0 where there are no rows.
  virtual std::uint64_t crossings() const { return 0; }
  /// Adds the product's own lines to the summary.
  virtual void report(Summary& summary) const = 0;
};

}  // namespace lamina::pipeline
