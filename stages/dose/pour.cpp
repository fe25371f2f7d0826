#include "stages/dose/pour.h"

#include <algorithm>

namespace lamina::dose {
namespace {

using Wide = unsigned __int128;
using DosePiece = PourScratch::DosePiece;

/// Takes the runs of a row apart into pieces of one number of drops.
class RunCutter {
 public:
  RunCutter(std::uint8_t full, const Sheet& sheet) : full_(full), sheet_(sheet) {}

  void cut(const Dosed& part, std::uint32_t row, std::vector<DosePiece>& pieces) {
    const LevelsView& zones = part.zones;
    for (std::uint32_t i = zones.row_offset[row]; i < zones.row_offset[row + 1]; ++i) {
      const bool core = zones.level[i] > full_;
      const DropRequest& request = core ? part.core : part.shell;
      const std::uint32_t level = zones.level[i] - (core ? full_ : 0u);
      const std::uint32_t begin = zones.change[2 * i], end = zones.change[2 * i + 1];
      if (request.field == nullptr) {
        add({begin, end, level, 0}, request.drops, pieces);
      } else {
        cut_blocks(*request.field, {begin, end, level, 0}, row, pieces);
      }
    }
  }

  ZoneSums sums() const {
    const Wide one = Wide{kOneDrop} * full_;
    return {(2 * levels_ + full_) / (2 * full_), static_cast<std::uint64_t>((2 * requested_ + one) / (2 * one))};
  }

 private:
  void add(DosePiece piece, Drops24 requested, std::vector<DosePiece>& pieces) {
    const std::uint64_t length = piece.end - piece.begin;
    levels_ += length * piece.level;
    requested_ += Wide{requested} * (length * piece.level);
    piece.drops = std::min(requested, sheet_.limit) * piece.level / full_;
    pieces.push_back(piece);
  }

  void cut_blocks(Field& field, const DosePiece& run, std::uint32_t row, std::vector<DosePiece>& pieces) {
    const std::uint32_t block_row = sheet_.block_row(row);
    for (std::uint32_t at = run.begin; at < run.end;) {
      const Drops24 requested = field.drops_of(sheet_.block_column(at), block_row);
      std::uint32_t stop = std::min(run.end, sheet_.block_end(at));
      while (stop < run.end && field.drops_of(sheet_.block_column(stop), block_row) == requested)
        stop = std::min(run.end, sheet_.block_end(stop));
      add({at, stop, run.level, 0}, requested, pieces);
      at = stop;
    }
  }

  std::uint8_t full_;
  const Sheet& sheet_;
  std::uint64_t levels_ = 0;
  Wide requested_ = 0;
};

/// Pieces of several parts, in any order, become those of all: where they overlap their drops add up.
void merge(PourScratch& scratch) {
  scratch.changes.clear();
  for (const DosePiece& piece : scratch.pieces) {
    const auto drops = static_cast<std::int64_t>(piece.drops);
    const auto level = static_cast<std::int32_t>(piece.level);
    scratch.changes.push_back({piece.begin, level, drops});
    scratch.changes.push_back({piece.end, -level, -drops});
  }
  std::ranges::sort(scratch.changes, {}, &PourScratch::Change::at);
  scratch.pieces.clear();
  std::int64_t drops = 0;
  std::int32_t level = 0;
  for (std::size_t i = 0; i < scratch.changes.size(); ++i) {
    const PourScratch::Change& change = scratch.changes[i];
    drops += change.drops;
    level += change.level;
    if (level == 0) continue;
    const std::uint32_t end = scratch.changes[i + 1].at;  // a level above 0 ends somewhere
    if (end > change.at)
      scratch.pieces.push_back({change.at, end, static_cast<std::uint32_t>(level), static_cast<Drops24>(drops)});
  }
}

}  // namespace

std::uint64_t PourScratch::bytes() const {
  return pieces.capacity() * sizeof(DosePiece) + changes.capacity() * sizeof(Change) + thresholds.bytes();
}

Result<ZoneSums> pour(std::span<const Dosed> parts, std::uint8_t full, const Sheet& sheet, PourScratch& scratch, Levels& result,
                      Levels& levels) {
  RunCutter cutter(full, sheet);
  if (sheet.dithered) scratch.thresholds.start(sheet.layer.index);
  result.start(sheet.grid.columns());
  levels.start(sheet.grid.columns());
  for (std::uint32_t row = 0; row < sheet.grid.rows(); ++row) {
    scratch.pieces.clear();
    std::uint32_t here = 0;
    for (const Dosed& part : parts) {
      const std::size_t before = scratch.pieces.size();
      cutter.cut(part, row, scratch.pieces);
      here += scratch.pieces.size() > before ? 1 : 0;
    }
    if (here > 1) merge(scratch);
    for (const DosePiece& piece : scratch.pieces) {
      levels.append(piece.begin, piece.end, static_cast<std::uint8_t>(piece.level));
      if (sheet.dithered) {
        scratch.thresholds.append(piece.begin, piece.end, row, piece.drops, result);
      } else {
        result.append(piece.begin, piece.end, static_cast<std::uint8_t>(rounded(piece.drops) >> kDropBits));
      }
    }
    result.end_row();
    levels.end_row();
  }
  for (const Dosed& part : parts) {
    for (const Field* field : {part.shell.field, part.core.field}) {
      if (field != nullptr && field->fault()) return *field->fault();
    }
  }
  return cutter.sums();
}

}  // namespace lamina::dose
