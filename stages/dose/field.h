// stages/dose/field.h: a saturation that depends on the position: formulas of x, y and z.
//
// A formula is taken for blocks of 4 x 4 pixels, counted from the left front corner of the bed, at the middle of the block
// and of the layer: all of a block's pixels request the same. x, y and z are mm from the corner of the bed; those of a part's
// own formula from the least corner of its box as it stands, each copy from its own.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/dose/saturation.h"
#include "stages/support/text/formula.h"

namespace lamina::dose {

inline constexpr std::uint32_t kBlockSide = 4;

/// Most per cent that a formula may give.
inline constexpr double kMaxPercent = 10'000;

/// A part, at most: everything of it lies within the box. nm along x, y and z; grown by its bleed.
struct ZoneBox {
  std::uint32_t zone = 0;
  std::array<std::int64_t, 3> low{}, high{};
  std::array<std::int64_t, 3> origin{};  // corner of the part, from which a formula of its own counts
};

/// A formula of x, y and z.
Result<Formula> parse_saturation(const std::string& text);

/// How the image of a layer lies on the bed, and what its formulas hold to.
struct Sheet {
  PixelGrid grid;
  bool mirror_x = false, mirror_y = false;  // columns, rows run the other way
  Layer layer{};
  DropScale scale{};
  Drops24 limit = 0;    // of a pixel
  Drops24 minimum = 0;  // full pixels that get less are a fault
  double min_percent = 0;
  bool dithered = true;  // else what a pixel gets is rounded to whole drops

  /// Of an image's column, and of its row.
  std::uint32_t block_column(std::uint32_t column) const {
    return (mirror_x ? grid.columns() - 1 - column : column) / kBlockSide;
  }
  std::uint32_t block_row(std::uint32_t row) const { return (mirror_y ? row : grid.rows() - 1 - row) / kBlockSide; }
  /// The first column behind that of the same block.
  std::uint32_t block_end(std::uint32_t column) const {
    const std::uint32_t block = block_column(column);
    return mirror_x ? grid.columns() - block * kBlockSide : (block + 1) * kBlockSide;
  }
};

/// A formula in one layer; scratch, reused by later layers, of one thread.
class Field {
 public:
  /// key     as the job names it, for messages
  /// copies  of a part with a formula of its own, whose frame is the nearest one's; none: the frame is the bed
  /// sheet, copies  outlive the layer
  /// errors  kUsage: the formula is none
  Status start(const std::string& formula, std::string_view key, const Sheet& sheet, std::span<const ZoneBox> copies);

  /// Drops that a full pixel of a block requests, without the limit; a block is evaluated once a band of rows.
  /// 0 where it has none: fault() then says why
  Drops24 drops_of(std::uint32_t block_column, std::uint32_t block_row) {
    if (block_row != band_) begin_band(block_row);
    if (block_column < known_.size() && known_[block_column] == stamp_) return drops_[block_column];
    return evaluate(block_column);
  }
  /// The first place without a number of per cent, or with less than binds.
  const std::optional<Error>& fault() const { return fault_; }
  std::uint64_t bytes() const {
    return drops_.capacity() * 8 + known_.capacity() * 4 + (here_.capacity() + near_.capacity()) * 8;
  }

 private:
  void begin_band(std::uint32_t row);
  Drops24 evaluate(std::uint32_t column);
  void blame(double value, bool binds);

  std::string key_;
  std::optional<Formula> formula_;
  const Sheet* sheet_ = nullptr;
  std::vector<const ZoneBox*> here_, near_;  // copies in the layer, and of them those that the band meets
  bool copies_ = false, flat_ = false;       // flat: one value in the layer
  std::uint32_t band_ = UINT32_MAX, stamp_ = 0;
  std::array<double, 3> position_{};
  std::vector<Drops24> drops_;        // by block of the band
  std::vector<std::uint32_t> known_;  // the stamp of the band that drops_ is of
  std::optional<Error> fault_;
};

/// Least and most per cent that a formula gives within boxes, by samples: all blocks, or a grid of them.
struct FieldRange {
  double minimum = 0, maximum = 0;
  bool any = false;  // else no sample has a number of 0 to kMaxPercent
  bool each = true;  // all of them have
};
class FieldSurvey {
 public:
  /// boxes    of the parts; own: each has its own frame
  /// layers   of the job, among which the samples are shared out
  /// errors   kUsage: the formula is none
  static Result<FieldSurvey> make(const std::string& formula, const PixelGrid& grid, std::vector<ZoneBox> boxes, bool own,
                                  std::uint32_t layers);
  /// Of those boxes that the layer meets. cost  at most some million evaluations over all layers
  FieldRange in(const Layer& layer);

 private:
  FieldSurvey(Formula formula, const PixelGrid& grid) : formula_(std::move(formula)), grid_(grid) {}
  void inspection(const ZoneBox& box, Nm plane, std::uint64_t maximum, FieldRange& found);

  Formula formula_;
  PixelGrid grid_;
  std::vector<ZoneBox> boxes_;
  bool own_ = false;
  std::uint32_t layers_ = 1;
  std::optional<FieldRange> always_;  // of a formula that does not depend on z
};

}  // namespace lamina::dose
