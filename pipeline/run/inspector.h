// pipeline/run/inspector.h: looks through the layers of a powder job on request (stages/inspect/).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/plan/plan.h"
#include "pipeline/run/summary.h"
#include "stages/inspect/inspect.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

class Inspector {
 public:
  /// Idle unless the job asks for it. The plan must outlive this object.
  explicit Inspector(const Plan& plan);
  bool on() const { return inspection_.has_value(); }

  /// What of a layer in flight waits for its turn.
  struct Work {
    Runs image;
    inspect::ThinScratch scratch;
    inspect::ThinPlaces thin;
    std::uint64_t bytes() const { return bytes_held(image.row_offset) + bytes_held(image.change) + scratch.bytes(); }
  };
  /// Keeps the section of a layer; from any thread.
  void look(const Runs& image, Work& work) const;
  /// In layer order.
  void record(const Layer& layer, const Work& work) { inspection_->add(layer, work.image, work.thin); }
  /// A layer of an earlier run, whose image is not at hand: bodies cannot be followed.
  void keep() { kept_ = true; }

  /// After the last layer.
  void warn(std::vector<Warning>& warnings);
  void tell(Summary& summary) const;

  // --- DIR/inspection.json, for reports: of whole jobs that were looked at from the first layer to the last
  /// Before the first layer. errors  kUsage: a file of somebody else has that name
  Status check_file() const;
  /// After warn(). Without findings of this run the file stays if it is of the same job, and is removed if it is of another.
  Status write(const ManifestHead& head) const;

 private:
  bool whole() const;
  nlohmann::ordered_json json() const;

  const Plan& plan_;
  std::optional<inspect::Inspection> inspection_;
  std::vector<Warning> told_;
  double least_mm_ = 0;
  bool kept_ = false;
};

}  // namespace lamina::pipeline
