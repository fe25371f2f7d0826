#include "stages/checks/inspect.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stages/support/text/readable.h"

namespace lamina::checks {
namespace {

/// An estimate of the bytes to inspect an uninspected layer: enough with as many bodies below as in it.
std::uint64_t expected_bytes(const RunsView& image, const PixelBox& all) {
  Follower solid(true);
  solid.find(image);
  std::uint64_t bodies = solid.need(image);
  solid = Follower(true);
  Runs between;
  complement(image, all, between);
  Follower powder(false);
  powder.find(between);
  bodies += powder.need(between);
  // Image, powder, columns, and scratch of thin places.
  return image.change.size_bytes() * 40 + image.row_offset.size_bytes() * 30 + bodies + bodies / 2;
}

std::string at(const Spot& spot) {
  return fmt::format("at x {:.2f}, y {:.2f}, z {:.2f} mm (layer {})", spot.x_mm, spot.y_mm, spot.z_mm, spot.layer);
}

std::string of(std::uint64_t count, std::string_view one, std::string_view several) {
  return count == 1 ? fmt::format("one {}", one) : fmt::format("{} {}", count, several);
}

std::string name_of(std::span<const std::string> part, std::uint32_t number) {
  return number < part.size() ? part[number] : fmt::format("part {}", number);
}

}  // namespace

void Found::note_location(const Location& position) {
  locations.push_back(position);
  if (locations.size() >= 4 * kMax) sort_locations();
}

void Found::sort_locations() {
  std::ranges::stable_sort(locations, [](const Location& a, const Location& b) {
    return a.amount != b.amount ? a.amount > b.amount : a.spot.layer < b.spot.layer;
  });
  locations.resize(std::min(locations.size(), kMax));
}

/// What set pixels are followed for.
struct Inspection::Solids {
  Inspection& all;
  std::uint64_t islands = 0;  // of this layer

  void grow(Body&) {}
  void begin(Body& body) {
    // A part begins in the layer that holds its bottom, or in the one above: then its first pixels lie above a layer's middle.
    const std::uint32_t placed_part = all.owner_of(body, all.below_, body.top);
    body.owner = placed_part != Body::kNone ? placed_part : all.first_of_several(body);
    body.open = body.owner != Body::kNone;  // it has the bottom of a part
    if (body.open) return;
    body.owner = all.owner_of(body, INT64_MIN, body.top);
    ++islands;
    all.note_body(all.findings_.islands, body, static_cast<double>(body.pixels) * all.pixel_mm2_, body.first_layer);
  }
  void join(const Body& stays, const Body& ends, const Body& piece) {
    if (stays.owner == Body::kNone || ends.owner == Body::kNone || stays.owner == ends.owner) return;
    all.note_touching(stays.owner, ends.owner, piece.box, all.layer_);
  }
  void end(const Body& body) {
    if (body.open) return;
    all.note_body(all.findings_.loose, body, static_cast<double>(body.pixel_nm) * 1e-6 * all.pixel_mm2_, body.last_layer);
  }
};

/// What the powder between set pixels is followed for.
struct Inspection::Powder {
  Inspection& all;

  void begin(Body&) {}
  void grow(Body& body) {
    const PixelBox& box = body.box;
    body.open = all.findings_.layers == 0 || box.left == all.all_.left || box.right == all.all_.right ||
                box.top == all.all_.top || box.bottom == all.all_.bottom;
  }
  void join(const Body& stays, const Body& ends, const Body&) { all.measures_.join_powder(stays.owner, ends.owner); }
  void end(const Body& body) {
    all.measures_.end_powder(body.owner, body.open);
    const double volume = static_cast<double>(body.pixel_nm) * 1e-6 * all.pixel_mm2_;
    if (body.open || volume < all.min_mm_ * all.min_mm_ * all.min_mm_) return;
    all.note_body(all.findings_.hollows, body, volume, body.last_layer);
  }
};

Inspection::Inspection(const PixelGrid& grid, std::vector<checks::Solid> placed_parts, std::int64_t min_nm,
                       std::int64_t drain_nm, std::uint64_t max_bytes)
    : grid_(grid),
      placed_parts_(std::move(placed_parts)),
      measures_(grid, min_nm, drain_nm),
      min_mm_(static_cast<double>(min_nm) / kNmPerMm),
      pixel_mm2_(1 / (grid.x.pixels_per_nm() * grid.y.pixels_per_nm() * kNmPerMm * kNmPerMm)),
      max_bytes_(max_bytes) {
  std::ranges::stable_sort(placed_parts_, {}, [](const checks::Solid& placed_part) { return placed_part.box.lo.z; });
  for (const checks::Solid& placed_part : placed_parts_) {
    window_.push_back(pixels_of(placed_part.box, grid_, 1));
    all_.add(pixels_of(placed_part.box, grid_, measures_.margin()));
  }
  if (placed_parts_.empty()) all_ = {0, 0, 0, 0};
  top_ = all_.top;
  const auto move = [&](PixelBox& box) { box.top -= top_, box.bottom -= top_; };
  move(all_);
  std::ranges::for_each(window_, move);
  measures_.set_window(all_);
}

Spot Inspection::spot(const PixelBox& box, std::uint32_t layer, std::int64_t z) const {
  const std::int64_t column = (std::int64_t{box.left} + box.right - 1) / 2,
                     row = top_ + (std::int64_t{box.top} + box.bottom - 1) / 2;
  return {mm(grid_.x.centre(column)), mm(grid_.y.centre(std::int64_t{grid_.rows()} - 1 - row)), layer, mm(z)};
}

Location Inspection::position(const PixelBox& box, const Spot& at, double amount, std::uint32_t last_layer) const {
  const auto mm_of = [](std::uint32_t pixels, const PixelAxis& axis) { return pixels / axis.pixels_per_nm() / kNmPerMm; };
  const std::uint32_t rows = grid_.rows() - top_;
  return {
      amount,
      at,
      {mm_of(box.left, grid_.x), mm_of(rows - box.bottom, grid_.y), mm_of(box.right, grid_.x), mm_of(rows - box.top, grid_.y)},
      last_layer,
      Body::kNone};
}

void Inspection::note_body(Found& found, const Body& body, double amount, std::uint32_t last_layer) {
  const Spot at = spot(body.box, body.first_layer, body.bottom);
  ++found.count;
  found.amount += amount;
  found.note_location(position(body.box, at, amount, last_layer));
  if (amount <= found.largest) return;
  found.largest = amount;
  found.spot = at;
}

void Inspection::note_measured() {
  for (const Measures::Item& item : measures_.found()) {
    const bool drain = item.kind == Measured::kDrain;
    Found& found = drain                             ? findings_.drains
                   : item.kind == Measured::kRoof    ? findings_.roofs
                   : item.kind == Measured::kGap     ? findings_.gaps
                   : item.kind == Measured::kContact ? findings_.contacts
                                                     : findings_.thin;
    const double size = drain ? item.pixel_nm * 1e-6 : static_cast<double>(item.pixels);
    note_body(found, item.body, size * pixel_mm2_, item.body.last_layer);
  }
  measures_.found().clear();
}

/// The part with the smallest box around the middle of each location.
void Inspection::name_parts(Found& found) const {
  for (Location& at : found.locations) {
    const auto in = [](double mm_at, Nm low, Nm high) { return mm(low) <= mm_at && mm_at <= mm(high); };
    double smallest = 0;
    for (const checks::Solid& placed : placed_parts_) {
      const Box& box = placed.box;
      if (!in(at.spot.x_mm, box.lo.x, box.hi.x) || !in(at.spot.y_mm, box.lo.y, box.hi.y) || at.spot.z_mm > mm(box.hi.z))
        continue;
      const double area = mm(box.width()) * mm(box.depth());
      if (at.part != Body::kNone && area >= smallest) continue;
      at.part = placed.part;
      smallest = area;
    }
  }
}

/// Whether all of a body lies where a copy's box is.
bool Inspection::is_in(std::uint32_t placed_part, const Body& body) const {
  const PixelBox &window = window_[placed_part], &box = body.box;
  return window.left <= box.left && box.right <= window.right && window.top <= box.top && box.bottom <= window.bottom &&
         placed_parts_[placed_part].box.lo.z < body.top && body.bottom <= placed_parts_[placed_part].box.hi.z;
}

/// The copy with the narrowest box around a body, of those whose bottoms lie in [from, to); kNone without one.
std::uint32_t Inspection::owner_of(const Body& body, std::int64_t from, std::int64_t to) const {
  const auto bottom = [](const checks::Solid& placed_part) { return std::int64_t{placed_part.box.lo.z}; };
  const auto first = std::ranges::lower_bound(placed_parts_, from, {}, bottom),
             last = std::ranges::lower_bound(placed_parts_, to, {}, bottom);
  std::uint32_t owner = Body::kNone;
  std::int64_t narrowest = 0;
  for (auto placed_part = first; placed_part < last; ++placed_part) {
    const auto number = static_cast<std::uint32_t>(placed_part - placed_parts_.begin());
    if (!is_in(number, body)) continue;
    const std::int64_t area = placed_part->box.width() / 1000 * (placed_part->box.depth() / 1000);
    if (owner != Body::kNone && area >= narrowest) continue;
    owner = number;
    narrowest = area;
  }
  return owner;
}

/// The first of the copies that begin together as one piece, wider than the box of any; kNone if the body is no such piece.
std::uint32_t Inspection::first_of_several(const Body& body) {
  std::uint32_t first = Body::kNone;
  const auto begins = [&](std::uint32_t s) { return placed_parts_[s].box.lo.z >= below_ && window_[s].meets(body.box); };
  for (std::uint32_t s = 0; s < placed_parts_.size() && placed_parts_[s].box.lo.z < body.top; ++s) {
    if (!begins(s)) continue;
    if (first == Body::kNone) {
      first = s;
      continue;
    }
    // Its neighbour among the copies before it.
    std::uint32_t neighbour = first;
    for (std::uint32_t before = first; before < s; ++before) {
      if (begins(before) && window_[before].meets(window_[s])) neighbour = before;
    }
    note_touching(neighbour, s, body.box, layer_);
  }
  return first;
}

/// within  where they are one piece: the place is where their own boxes meet in it
void Inspection::note_touching(std::uint32_t a, std::uint32_t b, const PixelBox& within, const Layer& layer) {
  PixelBox box = within;
  for (const PixelBox& window : {window_[a], window_[b]}) {
    if (window.meets(box)) box = box.common(window);
  }
  const std::uint32_t part = std::min(placed_parts_[a].part, placed_parts_[b].part),
                      other = std::max(placed_parts_[a].part, placed_parts_[b].part);
  auto& noted = findings_.touching;
  const bool known = std::ranges::any_of(noted, [&](const auto& pair) { return pair.part == part && pair.other == other; });
  if (!known && noted.size() < Findings::kMax) noted.push_back({part, other, spot(box, layer.index, layer.bottom)});
}

/// Bodies that have left the box of the copy that they began with: they have grown into another one.
void Inspection::note_outgrown(const Layer& layer) {
  for (Body& body : solid_.live()) {
    if (body.owner == Body::kNone) continue;
    if (is_in(body.owner, body) && layer.bottom < placed_parts_[body.owner].box.hi.z) continue;
    for (std::uint32_t other = 0; other < placed_parts_.size(); ++other) {
      const Box& box = placed_parts_[other].box;
      if (other == body.owner || !window_[other].meets(body.box) || box.lo.z >= layer.bottom + layer.thickness ||
          box.hi.z <= layer.bottom) {
        continue;
      }
      note_touching(body.owner, other, body.box, layer);
      break;
    }
    body.owner = Body::kNone;
  }
}

void Inspection::note_edges(const Layer& layer, const RunsView& image) {
  if (findings_.bed_edge || image.rows() == 0) return;
  const auto note = [&](std::uint32_t column, std::uint32_t row) {
    if (!findings_.bed_edge) findings_.bed_edge = spot({column, column + 1, row, row + 1}, layer.index, layer.bottom);
  };
  for (std::uint32_t r = 0; r < image.rows() && !findings_.bed_edge; ++r) {
    const auto row = image.row(r);
    if (row.empty()) continue;
    if (r + top_ == 0 || r + top_ + 1 == grid_.rows() || row.front() == 0) note(row.front(), r);
    if (row.back() == image.columns) note(row.back() - 1, r);
  }
}

std::uint64_t Inspection::bytes_needed(const RunsView& image) const {
  // The image, what lies around it and what is left of it, chains of these; rows of these, and of four that hold little.
  return stopped_ ? 0 : 14 * image.change.size_bytes() + 20 * image.row_offset.size_bytes();
}

void Inspection::prepare(const RunsView& image, LayerInspection& inspection) const {
  // At least half of what prepare() holds of noise, whose every run is left to chains of any form; of long chains it holds
  // less. A run: its ends, those of inner pixels and of samples, 24; simple chains of the powder, its ends and corners of
  // drains, 45; of chains and pieces that are left, their numbers, ends and what a stencil covers, 40. The powder has at least
  // as many runs as the image less one a row.
  constexpr std::uint64_t kOfRun = 24 + 45 + 40;
  const std::uint64_t runs = image.change.size() / 2, rows = all_.bottom, minimum = kOfRun * (2 * runs - std::min(runs, rows));
  const bool too_large = stopped_ || minimum > max_bytes_;
  copy_rows(image, top_, top_ + all_.bottom, inspection.image);
  inspection.min_bytes = !too_large ? 0 : stopped_ ? minimum : expected_bytes(inspection.image, all_);
  if (!too_large) {
    BorrowedScratch scratch(*this);
    return measures_.prepare(inspection.image, *scratch, inspection.measures);
  }
  const std::uint64_t bytes = inspection.min_bytes;
  inspection = {};
  inspection.min_bytes = bytes;
}

void Inspection::add_sample(const RunsView& sample, LayerInspection& inspection) const {
  if (inspection.min_bytes > 0) return;
  BorrowedScratch scratch(*this);
  RunsView rows = sample;
  if (sample.rows() < top_ + all_.bottom) {
    copy_rows(sample, top_, top_ + all_.bottom, (*scratch).outside);
    rows = (*scratch).outside;
  } else {
    rows.row_offset = sample.row_offset.subspan(top_, std::size_t{all_.bottom} + 1);
  }
  measures_.add_sample(rows, *scratch, inspection.measures);
}

Inspection::BorrowedScratch::BorrowedScratch(const Inspection& inspection) : inspection_(inspection) {
  const std::scoped_lock lock(inspection_.scratch_mutex_);
  if (inspection_.scratch_.empty()) {
    scratch_ = std::make_unique<ThinScratch>();
  } else {
    scratch_ = std::move(inspection_.scratch_.back());
    inspection_.scratch_.pop_back();
  }
}

Inspection::BorrowedScratch::~BorrowedScratch() {
  const std::scoped_lock lock(inspection_.scratch_mutex_);
  if (!inspection_.stopped_) inspection_.scratch_.push_back(std::move(scratch_));
}

std::uint64_t Inspection::scratch_bytes() const {
  const std::scoped_lock lock(scratch_mutex_);
  std::uint64_t total = 0;
  for (const std::unique_ptr<ThinScratch>& one : scratch_) total += one->bytes();
  return total;
}

void Inspection::stop(const Layer& layer, std::uint64_t bytes) {
  findings_.stop = {layer.index, mm(layer.bottom), bytes};
  measures_.finish();
  note_measured();
  leave();
}

void Inspection::leave() {
  stopped_ = true;
  {
    const std::scoped_lock lock(scratch_mutex_);
    scratch_.clear();
  }
  solid_ = Follower(true);
  powder_ = Follower(false);
  measures_ = Measures(grid_, 0, 0);
}

void Inspection::add(const Layer& layer, const LayerInspection& inspection) {
  if (stopped_) return;
  if (inspection.min_bytes > 0) return stop(layer, inspection.min_bytes);
  const RunsView image = inspection.image;
  solid_.find(image);
  const RunsView between = inspection.measures.powder;
  powder_.find(between);
  const std::uint64_t bytes = image.change.size_bytes() + image.row_offset.size_bytes() + solid_.need(image) +
                              powder_.need(between) + measures_.need(image, inspection.measures);
  if (bytes > max_bytes_) return stop(layer, bytes);
  layer_ = layer;
  // The first layer that holds anything is the bottom of what it holds.
  if (!holds_) below_ = INT64_MIN;
  holds_ = holds_ || !image.change.empty();
  measures_.add(layer, image, solid_.below(), inspection.measures, powder_);
  Solids solids{*this};
  solid_.add(layer, image, solids);
  if (solids.islands > 0) ++findings_.islands.layers;
  note_outgrown(layer);
  Powder powder{*this};
  powder_.add(layer, between, powder);
  note_measured();
  note_edges(layer, image);
  ++findings_.layers;
  below_ = layer.bottom;
}

const Findings& Inspection::finish() {
  Solids solids{*this};
  solid_.finish(solids);
  // What reaches the last layer is open at the top.
  struct Open {
    Measures& measures;
    void end(const Body& body) { measures.end_powder(body.owner, true); }
  } open{measures_};
  powder_.finish(open);
  measures_.finish();
  note_measured();
  for (Found* found : {&findings_.islands, &findings_.loose, &findings_.hollows, &findings_.drains, &findings_.thin,
                       &findings_.roofs, &findings_.gaps, &findings_.contacts}) {
    found->sort_locations();
    name_parts(*found);
  }
  return findings_;
}

namespace {

/// Adds warnings to a list.
struct Warnings {
  std::span<const std::string> part;
  std::vector<Warning>& list;

  void operator()(const char* code, const Spot& spot, std::string text, std::string of_part = {}) const {
    list.push_back({code, std::move(text), std::move(of_part), spot.layer, spot.z_mm});
  }
  /// With the part of the largest one, if it is known.
  void operator()(const char* code, const Found& found, const std::string& text) const {
    const std::uint32_t number = found.locations.empty() ? UINT32_MAX : found.locations.front().part;
    const std::string name = number < part.size() ? part[number] : std::string();
    (*this)(code, found.spot, name.empty() ? text : name + ": " + text, name);
  }
};

}  // namespace

void report(const Findings& findings, std::span<const std::string> part, double min_mm, double drain_mm,
            std::vector<Warning>& warnings) {
  const auto& [layers, islands, loose, hollows, drains, thin, roofs, gaps, contacts, touching, bed_edge, stop] = findings;
  const Warnings warn{part, warnings};
  if (islands.count > 0) {
    warn("islands", islands,
         fmt::format("{} of {} with nothing below, the largest of {:.3g} mm2 {}: only powder supports them until they join a "
                     "part; turn the part, or spread the first layers above them carefully",
                     of(islands.count, "piece", "pieces"), of(islands.layers, "layer", "layers"), islands.largest,
                     at(islands.spot)));
  }
  if (loose.count > 0) {
    warn("loose", loose,
         fmt::format("{} of {:.3g} mm3 that nothing joins to the bottom of a part, the largest {}: they fall off; repair the "
                     "part or take them out of it",
                     of(loose.count, "body", "bodies"), loose.amount, at(loose.spot)));
  }
  if (hollows.count > 0) {
    warn("hollows", hollows,
         fmt::format("{} of {:.3g} mm3 that powder cannot leave, the largest of {:.3g} mm3 {}: open them by holes, or let them "
                     "be solid",
                     of(hollows.count, "closed hollow", "closed hollows"), hollows.amount, hollows.largest, at(hollows.spot)));
  }
  if (drains.count > 0) {
    warn(
        "drains", drains,
        fmt::format("{} of about {:.3g} mm3 with drains narrower than {:.3g} mm, the largest of {:.3g} mm3 {}: powder stays in "
                    "them; widen the drains, or set a smaller --min-drain",
                    of(drains.count, "hollow", "hollows"), drains.amount, drain_mm, drains.largest, at(drains.spot)));
  }
  const auto narrow = [&](const Found& found, std::string_view one, std::string_view several, std::string_view advice) {
    return fmt::format("{} narrower than {:.3g} mm, the largest of {:.3g} mm2 {}: {}, or set a smaller --min-wall",
                       of(found.count, one, several), min_mm, found.largest, at(found.spot), advice);
  };
  const std::string_view breaks = "they may break; make them thicker",
                         closes = "they may close, or keep powder; make them wider";
  if (thin.count > 0) warn("thin", thin, narrow(thin, "wall or pin", "walls or pins", breaks));
  if (roofs.count > 0) warn("roofs", roofs, narrow(roofs, "roof or floor", "roofs or floors", breaks));
  if (gaps.count > 0) warn("gaps", gaps, narrow(gaps, "gap", "gaps", closes));
  if (contacts.count > 0) {
    warn("contacts", contacts,
         narrow(contacts, "edge, corner or neck that joins two bodies", "edges, corners or necks that join two bodies",
                "they may break; let the bodies overlap more"));
  }
  for (const Findings::Touching& pair : touching) {
    const std::string parts = pair.part == pair.other
                                  ? "copies of " + name_of(part, pair.part)
                                  : fmt::format("{} and {}", name_of(part, pair.part), name_of(part, pair.other));
    warn("touching", pair.spot,
         fmt::format("{} touch {}: they are printed as one body; increase their distance", parts, at(pair.spot)),
         pair.part < part.size() ? part[pair.part] : std::string());
  }
  if (bed_edge) {
    warn("bed-edge", *bed_edge,
         fmt::format("pixels are at the very edge of the bed, first {}: move the parts inwards", at(*bed_edge)));
  }
  if (stop) {
    constexpr std::uint64_t kMega = 1 << 20;
    warnings.push_back(
        {"not-inspected",
         fmt::format(
             "{}: inspecting layer {} takes about {}, more than half of --memory; give --memory {}M or more, or omit --inspect",
             layers == 0 ? "no layer was inspected"
                         : fmt::format("layers from {} on were not inspected; the results cover only those below", stop->layer),
             stop->layer, readable_bytes(stop->bytes), (2 * stop->bytes + kMega - 1) / kMega),
         {},
         stop->layer,
         stop->z_mm});
  }
}

}  // namespace lamina::checks
