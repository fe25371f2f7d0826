// pipeline/run/inspector.h: looks through the layers of a powder job on request (stages/checks/).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/image_observers.h"
#include "stages/checks/inspect.h"

namespace lamina::pipeline {

class Inspector : public ImageObserver {
 public:
  /// Idle unless the job asks for it. The plan must outlive this object.
  explicit Inspector(const Plan& plan);
  bool on() const { return inspection_.has_value(); }

  /// Those of layers in flight, from any thread, are its const functions. Of an idle one there is none.
  const checks::Inspection& inspection() const { return *inspection_; }
  /// In layer order.
  void record(const Layer& layer, const checks::LayerInspection& layer_inspection) {
    inspection_->add(layer, layer_inspection);
  }
  /// Beside the looks at layers.
  std::uint64_t bytes() const { return on() ? inspection_->bytes() : 0; }

  // --- observer
  /// The image of a layer of an earlier run is not available: bodies cannot be followed.
  void layer(const LayerRecord&, const ImageNotes* made) override {
    if (made != nullptr) return;
    kept_ = true;
    if (on()) inspection_->leave();
  }
  void warn(const Summary& summary, std::vector<Warning>& warnings) override;
  void report(Summary& summary) const override;

  // --- DIR/inspection.json, for reports: of whole jobs that were looked at from the first layer to the last
  /// Before the first layer. errors  kUsage: a file of somebody else has that name
  Status check_file() const;
  /// After warn(). Without findings of this run the file stays if it is of the same job, and is removed if it is of another.
  Status write(const ManifestHead& head) const;

 private:
  bool whole() const;

  const Plan& plan_;
  std::optional<checks::Inspection> inspection_;
  std::vector<Warning> reports_;
  double min_mm_ = 0;
  bool kept_ = false;
};

}  // namespace lamina::pipeline
