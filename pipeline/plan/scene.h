// pipeline/plan/scene.h: the parts of a job, loaded and placed on the bed: meshes and layer images.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/profiles.h"
#include "stages/arrange/placement.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/formats/images/layer_images.h"
#include "stages/formats/images/placed.h"
#include "stages/load/load.h"

namespace lamina::pipeline {

/// A copy of a part that is images, in whole pixels of the bed.
struct PlacedImages {
  std::uint32_t part = 0;  // index into Scene::parts
  std::shared_ptr<const formats::LayerImages> images;
  formats::Placement position;
  Nm bottom = 0, thickness = 0;  // of the first layer; of each

  /// The image whose heights hold the plane, if any.
  std::optional<std::uint32_t> image_at(Nm plane) const {
    const std::int64_t above = std::int64_t{plane} - bottom;
    if (above < 0 || above / thickness >= images->layers()) return std::nullopt;
    return static_cast<std::uint32_t>(above / thickness);
  }
};

/// Meshes in the coordinates of their files, and instances with offsets into the frame of the bed:
/// x from its left edge, y from its front edge, z from its surface; every coordinate within the bed and within int32.
struct Scene {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<PartSummary> parts;
  std::vector<std::uint32_t> part_of_instance;  // index into parts
  std::vector<PlacedImages> images;             // parts that are no meshes
  std::int64_t height = 0;                      // nm, highest point of all; > 0
};

/// How meshes come: lists; also blocks, for callers that only rasterize them; also blocks that keep the order of their files.
enum class MeshForm { kLists, kBlocks, kOrderedBlocks };

/// The load options for a part of a job.
load::LoadOptions load_options(const Job& job, const PartRequest& request);

/// Loads the parts of a job (equal files with equal transforms once) and places them on the bed.
///
/// A part with a position stays there; its copies follow along x at their width plus the gap. All other parts are
/// arranged in rows from the front left, in job order and gap_mm apart; this block is centred on the bed. Positions are
/// whole nm.
/// form    blocks: binary STL files may come as Mesh::blocks, a third of the memory, without or with the order of the file
/// grid    of the bed's pixels: parts may be images then
/// errors  kUsage if a part does not fit the bed (with the excess and a remedy); kInput from load
Result<Scene> load_scene(const Job& job, const Bed& bed, MeshForm form = MeshForm::kLists, const PixelGrid* grid = nullptr);

// --- checks that a powder printer can reach the parts of a job.

/// Checks that all parts lie on the bed and below the build height.
/// errors  kUsage with the part and its first point outside
Status check_reach(const Machine& machine, const Scene& scene);

/// The opened images of a part, with the data of a lamina manifest next to them and of the job's keys.
struct OpenImages {
  std::shared_ptr<const formats::LayerImages> images;
  std::array<DotPitch, 2> pitch{};  // the bed's where they are the same
  Nm bottom = 0, thickness = 0;
  std::int64_t width = 0, depth = 0;  // nm on the bed
  std::vector<Note> notes;
};

/// errors  kInput, kUsage: what the files, the manifest and the keys together leave open
Result<OpenImages> open_images(const Job& job, const PartRequest& part, const PixelGrid* grid);

/// The nearest whole pixel; a note reports it if it differs from the request.
PlacedImages placed_images(const OpenImages& open, const PartRequest& part, const PixelGrid& grid, std::int64_t x_nm,
                           std::int64_t y_nm, std::vector<Note>& notes);

/// The layers of a job of images alone are theirs; with meshes they are the job's. Sets job.layer_mm.
/// errors  kUsage: --layer or --heights or a filling that do not fit images
Status fit_layers(const Scene& scene, bool beads, Job& job);

}  // namespace lamina::pipeline
