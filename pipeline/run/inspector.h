// pipeline/run/inspector.h: inspects the layers of a powder job (--inspect), in one run or after runs of some layers each.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/manifest/kept_sections.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/image_observers.h"
#include "stages/checks/inspect.h"
#include "stages/support/io/compressed.h"

namespace lamina::pipeline {

/// Idle unless the job requests it. A run of some layers writes their sections for lamina merge; a dry run inspects them alone.
class Inspector : public ImageObserver {
 public:
  /// Of a layer in flight.
  struct SectionWork {
    checks::LayerInspection measured;
    Buffer<std::byte> kept;  // instead
    Runs sampled, both;
    std::uint64_t bytes() const {
      return measured.bytes() + bytes_held(kept) + checks::bytes_of(sampled) + checks::bytes_of(both);
    }
  };

  /// The plan must outlive this object.
  explicit Inspector(const Plan& plan);
  bool on() const { return plan_.job.inspect; }

  // --- from any thread, in this order
  /// Bytes that prepare() adds, about.
  std::uint64_t bytes_needed(const RunsView& image) const;
  void prepare(const RunsView& image, SectionWork& work) const;
  void add_sample(const RunsView& sample, SectionWork& work) const;
  void end(SectionWork& work) const;

  // --- in layer order
  Status record(const Layer& layer, const SectionWork& work);
  /// In addition to the work of layers.
  std::uint64_t bytes() const { return inspection_ ? inspection_->bytes() + inspection_->scratch_bytes() : 0; }

  // --- observer
  void layer(const LayerRecord&, const ImageNotes*) override {}
  void warn(const Summary& summary, std::vector<Warning>& warnings) override;
  void report(Summary& summary) const override;

  // --- files of the job's directory
  /// Before anything is written. errors  kUsage: a file of somebody else has a name that is needed
  Status check_file() const;
  /// Before the first layer, in the claimed directory. errors  of open_sections()
  Status open(const ManifestHead& head);
  /// After the last layer, before the manifest takes its name. errors  kOutput
  Status finish();
  /// The text of inspection.json; after warn(), of a whole job.
  std::string text(const ManifestHead& head) const;
  /// After warn() and the manifest. Without findings the file stays if it is of the same job, and is removed if it is of
  /// another.
  Status write(const ManifestHead& head) const;

 private:
  bool whole() const;
  bool keeps() const { return on() && !whole() && !plan_.job.dry_run; }

  const Plan& plan_;
  SectionsHead head_;
  std::optional<checks::Inspection> inspection_;
  std::optional<ContentWriter> sections_;
  std::vector<Warning> reports_;
};

/// Layers of a job whose sections a run has kept.
struct KeptLayers {
  std::string manifest;
  std::span<const LayerRecord> layers;
};

struct WholeInspection {
  std::optional<Json> facts;      // of inspection.json
  std::vector<Warning> warnings;  // also that it is not inspected, and why; none if no run was to inspect its layers
};

/// Inspects the layers of a whole job in order; the result equals that of an undivided run.
/// kept  in layer order. memory  that of their --memory. cost  that of the inspection
WholeInspection inspect_kept(const ManifestHead& job, std::span<const KeptLayers> kept);

}  // namespace lamina::pipeline
