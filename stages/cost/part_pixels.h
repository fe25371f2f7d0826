// stages/cost/part_pixels.h: the set pixels of each part in the image of all.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/levels.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/geometry/drop_rows.h"

namespace lamina::cost {

/// A part's body on the bed.
struct Body {
  Box box;                  // nm
  std::uint32_t part = 0;   // of the job
  std::uint32_t group = 0;  // bodies whose boxes touch in plan view; boxes around groups do not overlap
};

/// The box of all voxels that hold some of a box, for images of shares of voxels: pixels are set whose centres lie outside of
/// the part. Boxes of bodies with no voxel in common do not touch.
Box box_of_voxels(const Box& box, const PixelGrid& grid);

/// Windows of bodies in the images of a bed. Exact where boxes are separated in plan view. In a group of several parts the
/// group's pixels of a layer are shared by what is set in the windows of those bodies that reach the layer: exact again where
/// these windows have no set pixel in common.
class PartPixels {
 public:
  /// groups  numbered from 0. mirror_x, mirror_y  of the images
  PartPixels(std::span<const Body> bodies, std::size_t parts, const PixelGrid& grid, bool mirror_x, bool mirror_y);

  /// The pixels of each part; their sum is that of the groups. cost  rows of windows x log of a row's runs
  std::vector<std::uint64_t> count(const Layer& layer, const RunsView& runs) const;
  /// The same of shares of voxels, weighed by them: whole ones by the largest remainder. full  the level of a full voxel in
  /// the shell; a core's is twice that (dose/shares.h). voxels  that all come to
  std::vector<std::uint64_t> share(const Layer& layer, const LevelsView& image, std::uint8_t full, std::uint64_t voxels) const;
  /// The pixels of each part that are of any level, and the sums of its levels.
  std::vector<std::uint64_t> count(const Layer& layer, const LevelsView& image) const;
  std::vector<std::uint64_t> sum(const Layer& layer, const LevelsView& image) const;
  /// The drops of each part. counter  started with the image's patterns
  std::vector<std::uint64_t> drops(const Layer& layer, const DropImageView& image, const DropCounter& counter) const;

 private:
  struct BodyWindow {
    std::uint32_t left = 0, right = 0, top = 0, bottom = 0;  // [left, right) x [top, bottom)
    std::int64_t low = 0, high = 0;                          // nm
    std::uint32_t part = 0;
  };
  struct BodyGroup {
    BodyWindow around;
    std::vector<BodyWindow> bodies;
    bool one_part = true;
  };
  template <class Row>
  static std::uint64_t sum_in(const BodyWindow& window, std::uint32_t rows, const Row& row_of);
  template <class Row>
  std::vector<std::uint64_t> sums(const Layer& layer, std::uint32_t rows, const Row& row_of) const;
  std::vector<BodyGroup> groups_;
  std::size_t parts_;
};

}  // namespace lamina::cost
