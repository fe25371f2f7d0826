#include "stages/checks/measures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/combine.h"

namespace lamina::checks {
namespace {

constexpr std::array<std::uint32_t, 2> kNoRow{0, 0};

std::uint64_t size_of(const Runs& runs) { return 4 * (runs.change.size() + runs.row_offset.size()); }

void make_empty(std::uint32_t columns, std::uint32_t rows, Runs& runs) {
  runs.columns = columns;
  runs.row_offset.assign(std::size_t{rows} + 1, 0);
  runs.change.clear();
}

/// Set in the first image but not in the second, in the wanted rows; nothing in the others.
template <class Wanted>
void difference_in_rows(const RunsView& a, const RunsView& b, Wanted wanted, Runs& out) {
  out.columns = a.columns;
  out.row_offset.assign(1, 0);
  out.change.clear();
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    if (!wanted(r)) {
      out.row_offset.push_back(static_cast<std::uint32_t>(out.change.size()));
      continue;
    }
    const auto row = [&](const RunsView& image) {
      return r < image.rows() ? RunsView{a.columns, image.row_offset.subspan(r, 2), image.change}
                              : RunsView{a.columns, kNoRow, {}};
    };
    append_combined(row(a), row(b), SetOperation::kDifference, out);
  }
}

/// Rows of an image that a stencil can reach that is within the image: those near a run as wide as its widest row.
/// returns  whether there is any
bool keep_near_wide(const RunsView& image, const Stencil& stencil, Runs& result) {
  std::uint32_t widest = 0;
  for (const Stencil::StencilRow& row : stencil.rows) widest = std::max(widest, row.last - row.first + 1);
  const std::int64_t reach = std::ssize(stencil.rows);
  const auto is_wide = [&](std::uint32_t r) {
    const auto row = image.row(r);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      if (row[i + 1] - row[i] >= widest) return true;
    }
    return false;
  };
  make_empty(image.columns, 0, result);
  const auto append = [&](std::int64_t until, bool all) {
    for (std::int64_t r = std::ssize(result.row_offset) - 1; r < until; ++r) {
      if (all) {
        const auto row = image.row(static_cast<std::uint32_t>(r));
        result.change.insert(result.change.end(), row.begin(), row.end());
      }
      result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
    }
  };
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    if (!is_wide(r)) continue;
    append(std::int64_t{r} - reach, false);
    append(std::min<std::int64_t>(image.rows(), r + reach), true);
  }
  append(image.rows(), false);
  return !result.change.empty();
}

}  // namespace

std::uint64_t LayerMeasures::run_bytes() const {
  return size_of(powder) + size_of(channels) + size_of(necks) + size_of(solid.narrow) + size_of(solid.rest) +
         size_of(gaps.narrow) + size_of(gaps.rest) + size_of(inner) + size_of(sampled);
}

std::uint64_t Measures::ShortColumns::bytes() const {
  return bodies.bytes() + footprints.bytes() + bytes_of(footprint) + bytes_of(near) + bytes_of(wide) + bytes_held(ended) +
         bytes_held(within) + scratch.bytes();
}

Measures::Measures(const PixelGrid& grid, std::int64_t min_nm, std::int64_t drain_nm)
    : min_nm_(min_nm),
      drain_nm_(drain_nm),
      column_nm_(1 / grid.x.pixels_per_nm()),
      row_nm_(1 / grid.y.pixels_per_nm()),
      widths_(grid, min_nm),
      drains_(grid, drain_nm),
      roofs_(grid, std::min(2 * min_nm, kNmReach)),
      slots_(grid, std::min(3 * min_nm, kNmReach)),
      drain_(drains_.at(drains_.count() - 1)),
      roof_(roofs_.at(roofs_.count() - 1)),
      slot_(slots_.at(slots_.count() - 1)),
      columns_(grid.columns()),
      short_(min_nm) {}

std::uint32_t Measures::margin() const {
  const Stencil width = widths_.at(widths_.count() - 1);
  return 2 + std::max({width.columns, drain_.columns, static_cast<std::uint32_t>(width.rows.size()),
                       static_cast<std::uint32_t>(drain_.rows.size())});
}

double Measures::longest_nm(const Body& body) const {
  return std::max({column_nm_ * (body.box.right - body.box.left), row_nm_ * (body.box.bottom - body.box.top),
                   static_cast<double>(body.top - body.bottom)});
}

void Measures::prepare(const RunsView& image, ThinScratch& scratch, LayerMeasures& measures) const {
  complement(image, window_, measures.powder);
  if (min_nm_ > 0) {
    thin_regions(image, widths_, scratch, &measures.solid);
    thin_regions(measures.powder, widths_, scratch, &measures.gaps);
    drop_at_edge(window_, scratch, measures.gaps.narrow);
    measures.scratch.find(image, measures.solid, widths_.two_squares(widths_.count() - 1), measures.necks);
  }
  measures.has_sample = false;
  measures.sampled.change.clear();
  if (min_nm_ == 0 || widths_.count() < 2 || measures.powder.change.empty()) scratch.simple.find(measures.powder);
  if (drain_nm_ > 0) erode_found(measures.powder, window_, drain_, scratch, measures.channels);
  if (min_nm_ > 0) inner_pixels(image, measures.inner);
}

void Measures::add_sample(const RunsView& sample, ThinScratch& scratch, LayerMeasures& measures) const {
  if (min_nm_ == 0) return;
  if (!measures.has_sample) {
    copy_rows(sample, 0, rows_, measures.sampled);
    measures.has_sample = true;
    return;
  }
  combine(measures.sampled, sample, SetOperation::kIntersection, scratch.chosen);
  std::swap(measures.sampled, scratch.chosen);
}

std::uint64_t Measures::need(const RunsView& image, const LayerMeasures& measures) const {
  // Spans that end, their footprint, and of regions the bodies that they make.
  constexpr std::uint64_t kOfSpan = 40, kOfRegion = 120;
  const LayerMeasures& of = measures;
  return 3 * of.run_bytes() + thin_.columns.need(of.solid.narrow, thin_.base, kOfRegion) +
         slots_upright_.columns.need(of.gaps.narrow, slots_upright_.base, kOfRegion) + short_.need(image, kOfSpan) +
         channel_columns_.need(of.channels) + roofs_flat_.footprints.need({}) + gaps_flat_.footprints.need({});
}

struct Measures::EndUpright {
  Measures& all;
  Measured kind;
  void end(const Body& body) {
    const auto area = static_cast<double>(body.area), minimum = static_cast<double>(all.min_nm_);
    const bool tall = body.tall >= 4 || static_cast<double>(body.pixel_nm) >= 1.5 * minimum * area;
    if (!tall && 2 * body.detached < body.area) return;
    // A chip, of which no side is twice as long as the others.
    const double pixel = all.column_nm_ * all.row_nm_, longest = all.longest_nm(body);
    if (longest * longest * longest < 4 * pixel * static_cast<double>(body.pixel_nm)) return;
    all.found_.push_back({kind, body, body.area, 0});
  }
};

struct Measures::EndFlat {
  Measures& all;
  Measured kind;
  void end(const Body& body) { all.found_.push_back({kind, body, body.area, 0}); }
};

struct Measures::EndNeck {
  Measures& all;
  void begin(Body&) {}
  void grow(Body&) {}
  void join(const Body&, const Body&, const Body&) {}
  void end(const Body& body) {
    if (body.top - body.bottom < 2 * all.min_nm_) return;
    all.found_.push_back({Measured::kContact, body, body.pixels / (body.last_layer - body.first_layer + 1), 0});
  }
};

struct Measures::EndHidden {
  Measures& all;
  void begin(Body&) {}
  void grow(Body&) {}
  void join(const Body&, const Body&, const Body&) {}
  void end(const Body& body) {
    std::array<double, 3> sides{all.column_nm_ * (body.box.right - body.box.left),
                                all.row_nm_ * (body.box.bottom - body.box.top), static_cast<double>(body.top - body.bottom)};
    std::ranges::sort(sides);
    const auto minimum = static_cast<double>(all.min_nm_);
    if (sides[2] < 2 * minimum || sides[1] < minimum) return;
    all.found_.push_back({Measured::kGap, body, body.pixels / (body.last_layer - body.first_layer + 1), 0});
  }
};

struct Measures::EndChannel {
  Measures& all;
  Follower& powder;
  bool first;
  void begin(Body&) {}
  void grow(Body& body) {
    const auto rows = static_cast<std::uint32_t>(all.drain_.rows.size());
    const PixelBox &box = body.box, &window = all.window_;
    body.open = first || box.left == window.left || box.right + all.drain_.columns > window.right || box.top == window.top ||
                box.bottom + rows > window.bottom;
  }
  void join(const Body&, const Body&, const Body&) {}
  void end(const Body& body) {
    if (body.open) return;
    const auto cube = static_cast<double>(all.drain_nm_);
    const double pixel = all.column_nm_ * all.row_nm_, volume = static_cast<double>(body.pixel_nm) * pixel;
    if (volume < cube * cube * cube) return;
    const std::uint32_t rows = static_cast<std::uint32_t>(all.drain_.rows.size());
    Item item{Measured::kDrain, body, 0, 0};
    // From corners of the disc to what it covers: exact for a box.
    const auto low = static_cast<std::int64_t>(0.6 * cube);
    PixelBox& box = item.body.box;
    const double wide = box.right - box.left, deep = box.bottom - box.top, high = static_cast<double>(body.top - body.bottom);
    box.right += all.drain_.columns - 1;
    box.bottom += rows - 1;
    item.body.bottom -= std::min(low, body.bottom);
    item.pixel_nm = static_cast<double>(body.pixel_nm) * (box.right - box.left) * (box.bottom - box.top) / (wide * deep) *
                    static_cast<double>(body.top - item.body.bottom) / high;
    all.keep_pocket(item, powder, body.column + all.drain_.columns / 2, body.row + rows / 2);
  }
};

void Measures::keep_pocket(const Item& item, Follower& powder, std::uint32_t column, std::uint32_t row) {
  Body* const hollow = powder.body_at(column, row);
  if (hollow == nullptr || hollow->open) {
    found_.push_back(item);
    return;
  }
  std::uint32_t pocket;
  if (free_.empty()) {
    pocket = static_cast<std::uint32_t>(pockets_.size());
    pockets_.emplace_back();
  } else {
    pocket = free_.back();
    free_.pop_back();
  }
  pockets_[pocket] = {item, Body::kNone, pocket};
  if (hollow->owner == Body::kNone) {
    hollow->owner = pocket;
  } else {
    join_powder(hollow->owner, pocket);
  }
}

void Measures::join_powder(std::uint32_t stays, std::uint32_t ends) {
  if (stays == Body::kNone || ends == Body::kNone || stays == ends) return;
  pockets_[pockets_[stays].tail].next = ends;
  pockets_[stays].tail = pockets_[ends].tail;
}

void Measures::end_powder(std::uint32_t owner, bool open) {
  for (std::uint32_t pocket = owner; pocket != Body::kNone; pocket = pockets_[pocket].next) {
    if (open) found_.push_back(pockets_[pocket].item);
    free_.push_back(pocket);
  }
}

/// Of the layer below the last one, whose neighbours are known now, the pixels that are set around samples that are not.
void Measures::note_hidden(const RunsView& inner) {
  const RunsView both = both_inner_, sampled = sampled_;
  // The pixels that are inner ones in all three layers are in a sample.
  const auto covered = [&](std::uint32_t r) {
    const auto a = both.row(r), b = inner.row(r), sample = sampled.row(r);
    if (a.size() != sample.size() || !rows_aligned(a, b)) return a.empty() || b.empty();
    std::uint32_t outside = 0;
    for (std::size_t i = 0; i + 1 < a.size(); i += 2)
      outside |= static_cast<std::uint32_t>(std::max(a[i], b[i]) < sample[i]) |
                 static_cast<std::uint32_t>(sample[i + 1] < std::min(a[i + 1], b[i + 1]));
    return outside == 0;
  };
  make_empty(columns_, 0, between_layers_);
  for (std::uint32_t r = 0; r < rows_; ++r) {
    if (covered(r)) {
      between_layers_.row_offset.push_back(static_cast<std::uint32_t>(between_layers_.change.size()));
      continue;
    }
    const auto row = [&](const RunsView& of) { return RunsView{columns_, of.row_offset.subspan(r, 2), of.change}; };
    combine(row(both), row(inner), SetOperation::kIntersection, row_);
    append_combined(row_, row(sampled), SetOperation::kDifference, between_layers_);
  }
}

void Measures::add_hidden(const LayerMeasures& measures) {
  const bool any = begun_ && has_sample_ && !both_inner_.row_offset.empty();
  if (any) note_hidden(measures.inner);
  if (begun_ && (!hidden_.is_idle() || (any && !between_layers_.change.empty()))) {
    if (!any) make_empty(columns_, rows_, between_layers_);
    hidden_.find(between_layers_);
    EndHidden rules{*this};
    hidden_.add(latest_, between_layers_, rules);
  }
  if (begun_) combine(inner_, measures.inner, SetOperation::kIntersection, both_inner_);
  copy_runs(measures.inner, inner_);
  has_sample_ = measures.has_sample;
  if (has_sample_) copy_runs(measures.sampled, sampled_);
}

void Measures::add_channels(const Layer& layer, const RunsView& channels, Follower& powder) {
  const std::int64_t top = std::int64_t{layer.bottom} + layer.thickness;
  channel_columns_.add(top, channels, top - 6 * drain_nm_ / 10);
  const RunsView tall = channel_columns_.combined();
  channels_.find(tall);
  EndChannel rules{*this, powder, !begun_};
  channels_.add(layer, tall, rules);
}

void Measures::add_upright(const Layer& layer, const RunsView& image, const RunsView& below, const RunsView& narrow,
                           Measured kind, Upright& upright) {
  if (narrow.change.empty() && upright.columns.is_idle() && upright.bodies.is_idle())
    return make_empty(columns_, 0, upright.below);
  difference_in_rows(
      below, upright.below, [&](std::uint32_t r) { return !narrow.row(r).empty(); }, upright.base);
  upright.columns.add(layer, narrow, upright.base);
  const auto ended = upright.columns.ended();
  auto next = ended.begin();
  const auto ends_in = [&](std::uint32_t r) {
    while (next != ended.end() && next->row < r) ++next;
    return next != ended.end() && next->row == r;
  };
  difference_in_rows(image, narrow, ends_in, upright.next_base);
  copy_runs(narrow, upright.below);
  attach(upright.columns.ended(), upright.next_base, upright.ended);
  EndUpright rules{*this, kind};
  upright.bodies.add(layer, upright.ended, columns_, rows_, 3 * min_nm_, rules);
}

/// Of short columns that ended below this layer, those where the disc fits into all that ended a little below.
void Measures::end_flat(const Layer& layer, std::span<const ColumnSpan> ended, Measured kind, ShortColumns& flat) {
  const Stencil& disc = kind == Measured::kRoof ? roof_ : slot_;
  flat.ended.clear();
  for (const ColumnSpan& span : ended) {
    if (std::int64_t{layer.bottom} - span.bottom < min_nm_) flat.ended.push_back(span);
  }
  flat.within.clear();
  if (!flat.ended.empty()) {
    footprint(flat.ended, columns_, rows_, flat.footprint);
    flat.footprints.add(layer.bottom, flat.footprint, std::int64_t{layer.bottom} - 2 * min_nm_ - 1);
    const RunsView all = flat.footprints.combined();
    if (set_pixels(all) >= std::uint64_t{disc.columns} * disc.rows.size() / 2 && keep_near_wide(all, disc, flat.near)) {
      open(flat.near, disc, flat.scratch, flat.wide);
      clip(flat.ended, flat.wide, flat.within);
    }
  }
  EndFlat rules{*this, kind};
  flat.bodies.add(layer, flat.within, columns_, rows_, INT64_MAX, rules);
}

void Measures::add(const Layer& layer, const RunsView& image, const RunsView& below, const LayerMeasures& measures,
                   Follower& powder) {
  if (min_nm_ > 0) add_hidden(measures);
  latest_ = layer;
  if (drain_nm_ > 0) add_channels(layer, measures.channels, powder);
  if (min_nm_ > 0) {
    add_upright(layer, image, below, measures.solid.narrow, Measured::kThin, thin_);
    add_upright(layer, measures.powder, powder.below(), measures.gaps.narrow, Measured::kGap, slots_upright_);
    short_.add(layer, image, window_);
    end_flat(layer, short_.solid(), Measured::kRoof, roofs_flat_);
    end_flat(layer, short_.powder(), Measured::kGap, gaps_flat_);
    necks_.find(measures.necks);
    EndNeck rules{*this};
    necks_.add(layer, measures.necks, rules);
  }
  begun_ = true;
}

void Measures::finish() {
  if (!begun_ || min_nm_ == 0) return;
  const Layer above{latest_.index + 1, static_cast<Nm>(latest_.bottom + latest_.thickness), latest_.thickness};
  for (const auto& [kind, upright] : {std::pair(Measured::kThin, &thin_), std::pair(Measured::kGap, &slots_upright_)}) {
    upright->columns.finish();
    // Above the last layer is powder alone.
    make_empty(columns_, rows_, upright->next_base);
    if (kind == Measured::kGap) complement(upright->next_base, {0, columns_, 0, rows_}, upright->base);
    attach(upright->columns.ended(), kind == Measured::kGap ? upright->base : upright->next_base, upright->ended);
    EndUpright rules{*this, kind};
    upright->bodies.add(above, upright->ended, columns_, rows_, 3 * min_nm_, rules);
    upright->bodies.finish(rules);
  }
  short_.finish(above);
  end_flat(above, short_.solid(), Measured::kRoof, roofs_flat_);
  EndFlat roof{*this, Measured::kRoof}, gap{*this, Measured::kGap};
  roofs_flat_.bodies.finish(roof);
  gaps_flat_.bodies.finish(gap);
  EndNeck neck{*this};
  necks_.finish(neck);
  EndHidden hidden{*this};
  hidden_.finish(hidden);
}

std::uint64_t Measures::bytes() const {
  return thin_.bytes() + slots_upright_.bytes() + short_.bytes() + roofs_flat_.bytes() + gaps_flat_.bytes() +
         channel_columns_.bytes() + channels_.bytes() + necks_.bytes() + hidden_.bytes() + bytes_of(inner_) +
         bytes_of(both_inner_) + bytes_of(sampled_) + bytes_of(row_) + bytes_of(between_layers_) +
         pockets_.capacity() * sizeof(Pocket) + free_.capacity() * sizeof(std::uint32_t) + found_.capacity() * sizeof(Item);
}

}  // namespace lamina::checks
