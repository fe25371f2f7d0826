#include "stages/dose/layer_drops.h"

#include <algorithm>

#include "stages/dose/blue_noise.h"

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

void join_zones(std::span<const Runs> images, std::vector<ZonePiece>& scratch, Levels& result) {
  result.start(images.empty() ? 0 : images.front().columns);
  const std::uint32_t rows = images.empty() ? 0 : images.front().view().rows();
  for (std::uint32_t r = 0; r < rows; ++r) {
    scratch.clear();
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto row = images[i].view().row(r);
      for (std::size_t k = 0; k + 1 < row.size(); k += 2)
        scratch.push_back({row[k], row[k + 1], static_cast<std::uint8_t>(i + 1)});
    }
    std::ranges::sort(scratch, {}, &ZonePiece::begin);
    for (const ZonePiece& piece : scratch) result.append(piece.begin, piece.end, piece.level);
    result.end_row();
  }
}

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

std::uint64_t DropWork::bytes() const {
  std::uint64_t total = shares.bytes() + zones.bytes() + levels.bytes() + pour.bytes() + pieces.capacity() * sizeof(ZonePiece);
  for (const DepositedPart& part : deposited) total += part.bytes();
  total += shared.bytes();
  for (const Field& field : fields) total += field.bytes();
  for (const Levels& of : of_material) total += of.bytes();
  return total + up_to.bytes() + patterns.bytes() + counter.bytes();
}

void share_out(std::uint8_t full, std::uint32_t columns, std::uint32_t rows, DropWork& work) {
  if (work.deposited.empty()) {
    work.shares.start(columns);
    work.shares.row_offset.assign(std::size_t{rows} + 1, 0);
    return;
  }
  std::vector<Levels*> parts;
  for (DepositedPart& part : work.deposited) parts.push_back(&part.shares);
  share_out(parts, full, work.shared, work.shares);
}

DropBound bound_of(const DropRules& rules, const DropSizes& sizes) {
  const std::uint64_t maximum = std::max(1u, rules.max_drops), rows = sizes.rows;
  // Of blue noise each pixel may differ from the one before it, by one drop: in one plane. Where it ends there is an edge.
  const std::uint64_t parted = sizes.pixels == 0 ? 0 : sizes.edges + sizes.pixels;
  DropBound bound{sizes.edges + parted + 2, maximum * sizes.edges + parted + 2, 0, 0};
  if (rules.full == 0 && rules.max_drops == 0 && !rules.thins) return bound;
  const auto levels = [&](std::uint64_t runs) { return 18 * runs + 8 * (rows + 1); };
  const std::uint64_t core = rules.shell.half_width.empty() ? 0 : sizes.edges;
  const std::uint64_t runs = rules.full > 0 ? sizes.runs : sizes.edges / 2 + 1;
  bound.runs = runs + core;
  bound.bytes = levels(runs) + (core > 0 || sizes.zones || rules.thins ? levels(bound.runs) : 0);
  // A tile and the counts of its rows for each zone.
  bound.bytes += std::uint64_t{2} * std::max<std::uint32_t>(rules.full, sizes.doses) * (kTilePixels + 4096);
  if (sizes.materials > 1) bound.bytes += sizes.materials * levels(bound.runs);
  if (const std::uint64_t parts = sizes.parts; parts > 0) {
    // Of each part its shares with and without its core, what others leave of it, and its voxels half full.
    bound.bytes += 70 * runs + 18 * core * parts + 32 * parts * (rows + 1);
    bound.bytes += 112 * std::min(sizes.columns, runs) + 36 * sizes.columns + sizeof(std::uint32_t) * kTilePixels;
    // Drops of each material, and of those up to it.
    bound.runs = bound.changes;
    bound.bytes += levels(bound.changes) * (sizes.materials > 1 ? 2 + sizes.materials : 1);
  }
  return bound;
}

Difference take_half(std::uint8_t full, Runs& image, Runs& second, const DropWork& work) {
  threshold_levels(work.shares, half_of(full), second);
  const Difference found = difference(image, second);
  std::swap(image, second);
  return found;
}

namespace {

/// Shell and core in work.zones, by the levels in work.shares.
void mark_shell(const DropRules& rules, const Runs& image, std::uint8_t full, Runs& second, DropWork& work) {
  if (rules.shell.half_width.empty()) {
    threshold_levels(work.shares, 1, second);
  } else {
    erode(image, rules.shell, second);
  }
  mark_core(work.shares, second, full, work.zones);
}

/// Level 1 for the pixels of an image, 2 for those of its core, which erosion left of it.
void mark_runs(const RunsView& image, const RunsView& core, Levels& result) {
  result.columns = image.columns;
  result.row_offset.assign(std::size_t{image.rows()} + 1, 0);
  const std::size_t maximum = image.change.size() / 2 + core.change.size() + 1;
  result.change.resize(2 * maximum), result.level.resize(maximum);
  std::uint32_t* change = result.change.data();
  std::uint8_t* level = result.level.data();
  const auto put = [&](std::uint32_t begin, std::uint32_t end, std::uint8_t of) {
    change[0] = begin, change[1] = end, *level = of;  // an empty one is overwritten
    const std::size_t any = begin < end ? 1 : 0;
    change += 2 * any, level += any;
  };
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto runs = image.row(r), inside = core.row(r);
    std::size_t k = 0;
    for (std::size_t i = 0; i + 1 < runs.size(); i += 2) {
      std::uint32_t at = runs[i];
      for (; k < inside.size() && inside[k] < runs[i + 1]; k += 2) {
        put(at, inside[k], 1);
        put(inside[k], inside[k + 1], 2);
        at = inside[k + 1];
      }
      put(at, runs[i + 1], 1);
    }
    result.row_offset[r + 1] = static_cast<std::uint32_t>(level - result.level.data());
  }
  result.change.resize(static_cast<std::size_t>(change - result.change.data()));
  result.level.resize(static_cast<std::size_t>(level - result.level.data()));
}

/// What pixels get of the drops of work.zones.
void dither_zones(std::span<const Drops24> drops, std::uint32_t layer, DropWork& work) {
  make_zones(drops, layer, work.patterns);
  work.counter.start(work.patterns);
  work.drops.assign(1, {work.zones, &work.patterns});
}

}  // namespace

ZoneSums drops_of_layer(const DropRules& rules, const LayerDose& dose, std::uint32_t layer, const Runs& image, Runs& second,
                        DropWork& work) {
  const std::uint8_t full = std::max<std::uint8_t>(1, rules.full);
  const bool core = dose.requested_shell != dose.requested_inside;
  if (rules.full == 0 && core) {
    erode(image, rules.shell, second);
    mark_runs(image, second, work.zones);
  } else if (rules.full == 0) {
    levels_of(image, 1, work.zones);
  } else if (core) {
    mark_shell(rules, image, full, second, work);
  } else {
    std::swap(work.shares, work.zones);
  }
  std::vector<Drops24> drops(std::size_t{2} * full + 1);
  drops_of_zones(dose, full, rules.dithered, drops);
  dither_zones(drops, layer, work);
  work.patterns.edges_alone = rules.full > 0 && drops[full] % kOneDrop == 0 && drops[2 * full] % kOneDrop == 0;
  return sums_of(work.zones, full, dose);
}

ZoneSums drops_of_parts(const DropRules& rules, std::span<const LayerDose> doses, std::uint32_t layer,
                        std::span<const Runs> zone, const Runs& image, Runs& second, DropWork& work) {
  const auto count = static_cast<std::uint8_t>(zone.size());
  join_zones(zone, work.pieces, work.shares);
  mark_shell(rules, image, count, second, work);
  std::vector<Drops24> drops{0}, requested{0};
  for (const LayerDose& dose : doses) drops.push_back(dose.shell), requested.push_back(dose.requested_shell);
  for (const LayerDose& dose : doses) drops.push_back(dose.core), requested.push_back(dose.requested_inside);
  if (!rules.dithered) std::ranges::for_each(drops, [](Drops24& of) { of = rounded(of); });
  dither_zones(drops, layer, work);
  unsigned __int128 sum = 0;
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i < work.zones.level.size(); ++i) {
    const std::uint64_t length = work.zones.change[2 * i + 1] - work.zones.change[2 * i];
    pixels += length;
    sum += static_cast<unsigned __int128>(requested[work.zones.level[i]]) * length;
  }
  return {pixels, static_cast<std::uint64_t>((sum + kOneDrop / 2) >> kDropBits)};
}

Result<ZoneSums> drops_of_deposited(const DropRules& rules, const Sheet& sheet,
                                    std::span<const std::array<DropRequest, 2>> requests, std::uint32_t materials,
                                    const Runs& image, Runs& second, DropWork& work) {
  const std::uint8_t full = std::max<std::uint8_t>(1, rules.full);
  const bool shell = !rules.shell.half_width.empty();
  if (shell) erode(image, rules.shell, second);
  for (DepositedPart& part : work.deposited) {
    if (shell) mark_core(part.shares, second, full, part.zones);
  }
  work.of_material.resize(materials);
  std::vector<Dosed> parts;
  for (std::uint32_t material = 0;; ++material) {
    const bool last = material + 1 >= materials;
    parts.clear();
    for (const DepositedPart& part : work.deposited) {
      const auto& [of_shell, of_core] = requests[part.zone];
      if (last || part.material <= material)
        parts.push_back({shell ? part.zones.view() : part.shares.view(), shell ? of_shell : of_core, of_core});
    }
    const auto sums = pour(parts, full, sheet, work.pour, work.levels, work.zones);
    if (!sums) return sums;
    if (materials > 1 && material == 0) work.of_material[0] = work.levels;
    if (material > 0) surplus(work.levels, work.up_to, work.of_material[material]);
    if (last) {
      // Zone n: n drops.
      std::vector<Drops24> drops(std::size_t{kMaxDrops} + 1);
      for (std::size_t n = 0; n < drops.size(); ++n) drops[n] = Drops24{n} << kDropBits;
      make_zones(drops, sheet.layer.index, work.patterns);
      work.counter.start(work.patterns);
      work.drops.assign(1, {work.levels, &work.patterns});
      for (std::uint32_t m = 0; materials > 1 && m < materials; ++m)
        work.drops.push_back({work.of_material[m], &work.patterns});
      return sums;
    }
    std::swap(work.levels, work.up_to);
  }
}

void drops_of_core(const DropRules& rules, double share, std::uint32_t layer, const Runs& image, Runs& second, DropWork& work) {
  erode(image, rules.shell, second);
  mark_runs(image, second, work.zones);
  make_core(share, layer, work.patterns);
  work.counter.start(work.patterns);
  work.drops.assign(1, {work.zones, &work.patterns});
}

void separate_materials(std::span<const Runs> image, DropWork& work) {
  work.of_material.resize(image.size());
  for (std::size_t m = 0; m < image.size(); ++m) {
    within(work.drops[0].zones, image[m], work.of_material[m]);
    work.drops.push_back({work.of_material[m], &work.patterns});
  }
}

}  // namespace lamina::dose
