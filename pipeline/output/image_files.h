// pipeline/output/image_files.h: where the layers of a powder job go: a file for each image, the print program beside it,
// and the manifest.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/output/plan_head.h"
#include "pipeline/output/print_program.h"
#include "pipeline/plan/plan.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/write/image_format.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// The manifest's head of a plan of images.
ManifestHead image_head(const Plan& plan);

class ImageFiles {
 public:
  /// The plan has to outlive it.
  explicit ImageFiles(const Plan& plan);

  /// Makes the directory ready and begins its manifest.
  /// errors  kUsage: what is there is of another job; kOutput
  Status open();
  /// Layers that are still to be made, in increasing order, once it is open.
  const std::vector<std::uint32_t>& todo() const { return todo_; }
  /// Layers that stand from an interrupted run.
  const std::vector<LayerRecord>& kept() const { return kept_; }

  /// What a layer occupies on its way; reused by later layers.
  struct Work {
    std::unique_ptr<write::ImageEncoder> encoder;
    write::Bytes file;
    std::vector<write::Bytes> files;  // one for each material, if the job has several
    ProgramWork program;
    std::uint64_t bytes() const;
  };

  // --- from many threads at once, each with work of its own
  /// materials  empty unless the job has several
  Status encode(const Runs& whole, std::span<const Runs> materials, Work& work, LayerRecord& record) const;
  /// errors  kOutput; kUsage: the machine cannot feed the layer
  Status store(const Runs& whole, Work& work, LayerRecord& record) const;
  /// Bytes that a layer may need whose image has so many changes.
  std::uint64_t bytes_bound(std::uint64_t changes) const;

  // --- from one thread at a time
  /// In layer order; layers that stand are recorded where they belong.
  Status record(const LayerRecord& record);
  Status finish();
  /// An interrupted or failed job: its finished layers stay on record.
  Status keep();

 private:
  Status record_kept_below(std::uint32_t layer);
  Status encode_one(const Runs& image, Work& work, const LayerRecord& record, write::Bytes& file) const;

  const Plan& plan_;
  ManifestHead head_;
  const write::ImageFormat& format_;
  std::optional<PrintProgram> program_;
  std::optional<ManifestWriter> manifest_;
  std::vector<std::uint32_t> todo_;
  std::vector<LayerRecord> kept_;
  std::size_t next_kept_ = 0;
};

}  // namespace lamina::pipeline
