// pipeline/output/toolpath_file.h: writes the layers of an extrusion job: one file of moves, its manifest,
// and for SML its layer table (.rp3).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pipeline/manifest/layered_file.h"
#include "pipeline/plan/plan.h"
#include "pipeline/plan/raft.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::pipeline {

/// Refuses an existing file unless the job resumes or overwrites it. Changes nothing. errors  kUsage, kOutput
Status check_toolpath_output(const Job& job, const Extruder& machine);

class ToolpathFile {
 public:
  /// The plan must outlive this object.
  explicit ToolpathFile(const Plan& plan);

  /// A dry run writes to nowhere. errors  of LayeredFile::open
  Status open();
  LayeredFile& file() { return *file_; }
  const LayeredFile& file() const { return *file_; }

  /// Encodes the moves of a layer as text; from many threads at once, each with its own text.
  /// around  without objects, which are added; must outlive what is returned
  std::unique_ptr<formats::LayerMoves> layer(const Layer& layer, Buffer<char>& text,
                                             const formats::LayerSurroundings& around) const;
  /// As layer(), for one of the raft.
  std::unique_ptr<formats::LayerMoves> raft_layer(
      const Layer& layer, Buffer<char>& text, const std::optional<formats::LayerSurroundings::Progress>& progress) const;
  /// The layers under those of the parts, which the file lifts.
  const RaftPlan& raft() const { return raft_; }

  // --- from one thread at a time, in layer order
  /// Adds the travel from the layers before to a layer.
  void travel_from(const formats::MoveTotals& before, formats::MoveTotals& layer) const { format_->travel_from(before, layer); }
  /// totals  of all layers. returns  the file's size
  Result<std::uint64_t> finish(const formats::MoveTotals& totals);
  Status keep() { return file_ ? file_->keep() : Status(); }
  void discard();

 private:
  std::uint32_t layers() const { return raft_layers() + plan_.range[1] - plan_.range[0]; }
  std::uint32_t raft_layers() const { return static_cast<std::uint32_t>(raft_.layers.size()); }

  const Plan& plan_;
  RaftPlan raft_;
  std::vector<formats::ExtrusionObject> objects_;
  std::unique_ptr<formats::ExtrusionFormat> format_;
  std::optional<LayeredFile> file_;
};

}  // namespace lamina::pipeline
