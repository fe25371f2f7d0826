// pipeline/run/maker.h: what makes the layers of one product and sends them to its files.
//
// A new product is a Maker, a new kind of file a sink in pipeline/output/. run() moves layers through a maker's steps;
// the steps of one layer run one after the other, those of different layers at once.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "pipeline/flow/layers.h"
#include "pipeline/run/summary.h"
#include "stages/data/status.h"
#include "stages/write/manifest/record.h"

namespace lamina::pipeline {

/// As Step of the flow, for a layer of the job instead of a position among those that are made.
struct MakerStep {
  std::string_view name;
  std::function<Status(std::uint32_t layer, const Ticket&)> run;
  std::function<Result<std::uint64_t>(std::uint32_t layer, const Ticket&)> needs = {};
};

class Maker {
 public:
  virtual ~Maker() = default;

  /// Bytes that a layer may need before more is known of it; scratch, text and files.
  virtual std::uint64_t bytes_of(std::uint32_t layer) const = 0;

  // --- files: once, before the first layer
  /// Begins the files. returns  the layers that are still to be made, in increasing order
  /// errors  kUsage: what is there is of another job; kOutput
  virtual Result<std::vector<std::uint32_t>> open() = 0;
  /// Records of layers that stand from an interrupted run.
  virtual std::vector<LayerRecord> kept() const = 0;

  // --- layers
  virtual std::vector<MakerStep> steps() = 0;
  virtual bool records_from_work() const = 0;
  /// In layer order, one at a time: into the files, and into the summary's sums.
  virtual Status record(std::uint32_t layer, const Ticket& ticket) = 0;
  /// Adds a layer that stands.
  virtual void add_kept(const LayerRecord& record) = 0;
  virtual std::uint64_t bytes_held(std::uint32_t work) const = 0;
  virtual void let_go(std::uint32_t work) = 0;

  // --- the end
  /// Closes the files. returns  bytes written in all
  virtual Status finish() = 0;
  /// Nothing more is recorded. keep  finished layers stay for a resumed run; else what was begun goes
  virtual Status stop(bool keep) = 0;
  /// What only this product tells.
  virtual void tell(Summary& summary) const = 0;
};

}  // namespace lamina::pipeline
