#include "stages/checks/measures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/combine.h"

namespace lamina::checks {
namespace {

std::uint64_t size_of(const Runs& runs) { return 4 * (runs.change.size() + runs.row_offset.size()); }

void clear_rows(std::uint32_t columns, std::uint32_t rows, Runs& runs) {
  runs.columns = columns;
  runs.row_offset.assign(std::size_t{rows} + 1, 0);
  runs.change.clear();
}

}  // namespace

std::uint64_t LayerMeasures::run_bytes() const {
  return size_of(powder) + size_of(channels) + size_of(necks) + size_of(solid.wide) + size_of(solid.narrow) +
         size_of(gaps.wide) + size_of(gaps.narrow) + size_of(inner) + size_of(hidden);
}

std::uint64_t Measures::ShortColumns::bytes() const {
  std::uint64_t total = columns.bytes() + bodies.bytes() + bytes_of(all) + bytes_of(next) + bytes_of(wide) + bytes_held(ended) +
                        bytes_held(within) + scratch.bytes();
  for (const Strip& strip : strips) total += bytes_of(strip.footprint);
  return total;
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
      columns_(grid.columns()) {}

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
  clear_rows(image.columns, image.rows(), measures.hidden);
  inner_pixels(image, measures.inner);
  if (drain_nm_ > 0) erode(measures.powder, window_, drain_, scratch, measures.channels);
}

void Measures::add_sample(const RunsView& sample, ThinScratch& scratch, LayerMeasures& measures) const {
  combine(measures.inner, sample, SetOperation::kDifference, scratch.left);
  if (scratch.left.change.empty()) return;
  combine(measures.hidden, scratch.left, SetOperation::kUnion, scratch.chosen);
  std::swap(measures.hidden, scratch.chosen);
}

std::uint64_t Measures::need(const RunsView& image, const LayerMeasures& measures) const {
  // Spans that end, their footprint, and of regions the bodies that they make.
  constexpr std::uint64_t kOfSpan = 40, kOfRegion = 120;
  const LayerMeasures& of = measures;
  return 3 * of.run_bytes() + thin_.columns.need(of.solid.narrow, thin_.base, kOfRegion) +
         slots_upright_.columns.need(of.gaps.narrow, slots_upright_.base, kOfRegion) +
         roofs_flat_.columns.need(image, {}, kOfSpan) + gaps_flat_.columns.need(of.powder, {}, kOfSpan) +
         channel_columns_.need(of.channels, {}, kOfSpan);
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

/// The layer below the last one, whose neighbours are known now.
void Measures::add_hidden(const RunsView& inner, const RunsView& hidden) {
  if (begun_) {
    if (below_.row_offset.empty()) clear_rows(columns_, rows_, below_);
    combine(latest_hidden_, below_, SetOperation::kIntersection, between_layers_);
    combine(between_layers_, inner, SetOperation::kIntersection, below_);
    hidden_.find(below_);
    EndHidden rules{*this};
    hidden_.add(latest_, below_, rules);
  }
  std::swap(below_, latest_inner_);
  copy_runs(inner, latest_inner_);
  copy_runs(hidden, latest_hidden_);
}

void Measures::add_channels(const Layer& layer, const RunsView& channels, Follower& powder) {
  channel_columns_.add(layer, channels, {}, !begun_, drain_nm_);
  channel_columns_.taller(std::int64_t{layer.bottom} + layer.thickness, 6 * drain_nm_ / 10, columns_, tall_channels_);
  channels_.find(tall_channels_);
  EndChannel rules{*this, powder, !begun_};
  channels_.add(layer, tall_channels_, rules);
}

void Measures::add_upright(const Layer& layer, const RunsView& image, const RunsView& narrow, Measured kind, Upright& upright) {
  upright.columns.add(layer, narrow, upright.base);
  combine(image, narrow, SetOperation::kDifference, upright.next_base);
  attach(upright.columns.ended(), upright.next_base, upright.ended);
  EndUpright rules{*this, kind};
  upright.bodies.add(layer, upright.ended, columns_, rows_, 3 * min_nm_, rules);
  std::swap(upright.base, upright.next_base);
}

void Measures::add_flat(const Layer& layer, const RunsView& image, Measured kind, bool endless, ShortColumns& flat) {
  flat.columns.add(layer, image, {}, endless, min_nm_);
  end_flat(layer, image, kind, flat);
}

/// Of short columns that ended below this layer, those where the disc fits into all that ended a little below.
void Measures::end_flat(const Layer& layer, const RunsView&, Measured kind, ShortColumns& flat) {
  const Stencil& disc = kind == Measured::kRoof ? roof_ : slot_;
  flat.ended.clear();
  for (const ColumnSpan& span : flat.columns.ended()) {
    if (std::int64_t{layer.bottom} - span.bottom < min_nm_) flat.ended.push_back(span);
  }
  while (!flat.strips.empty() && layer.bottom - flat.strips.front().z > 2 * min_nm_) flat.strips.pop_front();
  flat.within.clear();
  if (!flat.ended.empty()) {
    ShortColumns::Strip& strip = flat.strips.emplace_back();
    strip.z = layer.bottom;
    footprint(flat.ended, columns_, rows_, strip.footprint);
    copy_runs(strip.footprint, flat.all);
    for (std::size_t i = 0; i + 1 < flat.strips.size(); ++i) {
      combine(flat.all, flat.strips[i].footprint, SetOperation::kUnion, flat.next);
      std::swap(flat.all, flat.next);
    }
    if (set_pixels(flat.all) >= std::uint64_t{disc.columns} * disc.rows.size() / 2) {
      open(flat.all, disc, flat.scratch, flat.wide);
      clip(flat.ended, flat.wide, flat.within);
    }
  }
  EndFlat rules{*this, kind};
  flat.bodies.add(layer, flat.within, columns_, rows_, INT64_MAX, rules);
}

void Measures::add(const Layer& layer, const RunsView& image, const LayerMeasures& measures, Follower& powder) {
  if (min_nm_ > 0) add_hidden(measures.inner, measures.hidden);
  latest_ = layer;
  if (drain_nm_ > 0) add_channels(layer, measures.channels, powder);
  if (min_nm_ > 0) {
    add_upright(layer, image, measures.solid.narrow, Measured::kThin, thin_);
    add_upright(layer, measures.powder, measures.gaps.narrow, Measured::kGap, slots_upright_);
    add_flat(layer, image, Measured::kRoof, false, roofs_flat_);
    add_flat(layer, measures.powder, Measured::kGap, !begun_, gaps_flat_);
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
    clear_rows(columns_, rows_, upright->next_base);
    if (kind == Measured::kGap) complement(upright->next_base, {0, columns_, 0, rows_}, upright->base);
    attach(upright->columns.ended(), kind == Measured::kGap ? upright->base : upright->next_base, upright->ended);
    EndUpright rules{*this, kind};
    upright->bodies.add(above, upright->ended, columns_, rows_, 3 * min_nm_, rules);
    upright->bodies.finish(rules);
  }
  roofs_flat_.columns.finish();
  end_flat(above, {}, Measured::kRoof, roofs_flat_);
  EndFlat roof{*this, Measured::kRoof}, gap{*this, Measured::kGap};
  roofs_flat_.bodies.finish(roof);
  gaps_flat_.bodies.finish(gap);
  EndNeck neck{*this};
  necks_.finish(neck);
  EndHidden hidden{*this};
  hidden_.finish(hidden);
}

std::uint64_t Measures::bytes() const {
  return thin_.bytes() + slots_upright_.bytes() + roofs_flat_.bytes() + gaps_flat_.bytes() + channel_columns_.bytes() +
         channels_.bytes() + necks_.bytes() + hidden_.bytes() + bytes_of(below_) + bytes_of(latest_inner_) +
         bytes_of(latest_hidden_) + bytes_of(between_layers_) + bytes_of(tall_channels_) +
         pockets_.capacity() * sizeof(Pocket) + free_.capacity() * sizeof(std::uint32_t) + found_.capacity() * sizeof(Item);
}

}  // namespace lamina::checks
