#include "stages/read/gcode.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "stages/data/input/file_reader.h"
#include "stages/data/text/readable.h"

namespace lamina::read {
namespace {

using Place = GcodeFile::Place;

constexpr double kFarthestMm = 2000;
constexpr ReadRules kRules{.fault = Fault::kUsage, .missing = "cannot be read; name a directory of a job or a G-code file"};

struct RawBead {
  double from[2], to[2], z, fed, length;  // mm
};

/// Carries out a file's lines one after another.
class Walk {
 public:
  Walk(FileReader& file, std::vector<std::string>& types) : path_(file.path()), types_(types), file_(file) {}

  void go_to(const Place& place) {
    place_ = place;
    file_.go_to(place.byte, place.line);
  }
  const Place& place() const { return place_; }  // in front of the line that next() reads
  std::optional<std::string> fault;
  bool layer_tag = false;  // the line begins a layer
  double filament_mm = 0;  // its diameter, where a comment tells it

  /// The next line that lays a bead or is the tag of a layer; false at the end, or if there is a fault.
  bool next(std::optional<RawBead>& bead) {
    bead.reset();
    layer_tag = false;
    while (!fault && read_line()) {
      if (text_.starts_with(';') ? tag() : command(bead)) return true;
    }
    return false;
  }
  /// Where the printer stood before the line that next() returned for.
  const Place& before() const { return before_; }

 private:
  bool read_line() {
    before_ = place_;
    const bool read = file_.next(text_);
    place_.line += read || !file_.status() ? 1 : 0;
    place_.byte = file_.offset();
    if (!file_.status()) return fail("is no text of G-code; name a file that lamina extrude or a slicer wrote"), false;
    if (!read) return false;
    while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\t')) text_.remove_prefix(1);
    if (text_.ends_with('\r')) text_.remove_suffix(1);
    return true;
  }

  void fail(std::string what) { fault = fmt::format("{}: line {}: {}", path_, place_.line, what); }

  double tag_number(std::string_view text) {
    double value = 0;
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || !(value >= 0 && value < kFarthestMm)) {
      fail(fmt::format("'{}' is not a length", one_line(text.substr(0, 40))));
      return 0;
    }
    return value;
  }

  bool tag() {
    if (text_.starts_with(";LAYER_CHANGE") || text_.starts_with(";LAYER:")) return layer_tag = true;
    if (text_.starts_with(";WIDTH:")) place_.width = tag_number(text_.substr(7));
    if (text_.starts_with(";HEIGHT:")) place_.height = tag_number(text_.substr(8));
    constexpr std::string_view kDiameter = "; filament_diameter = ";  // Slic3r and its kin, at the end of the file
    if (text_.starts_with(kDiameter)) {
      const std::string_view value = text_.substr(kDiameter.size());
      std::from_chars(value.data(), value.data() + value.size(), filament_mm);
    }
    if (text_.starts_with(";TYPE:")) {
      const std::string name = one_line(text_.substr(6, 40));
      const auto known = std::ranges::find(types_, name);
      place_.type = static_cast<std::uint32_t>(known - types_.begin());
      if (known == types_.end() && types_.size() < 100) types_.push_back(name);
      place_.type = std::min<std::uint32_t>(place_.type, static_cast<std::uint32_t>(types_.size() - 1));
    }
    return false;
  }

  /// The number behind a letter; moves behind it.
  bool number(std::string_view& left, double& value) {
    const std::string_view all = left;
    if (left.starts_with('+')) left.remove_prefix(1);
    const auto [end, code] = std::from_chars(left.data(), left.data() + left.size(), value);
    if (code != std::errc() || !std::isfinite(value)) {
      fail(fmt::format("'{}' is not a number", one_line(all.substr(0, std::min<std::size_t>(all.find(' '), 20)))));
      return false;
    }
    left.remove_prefix(static_cast<std::size_t>(end - left.data()));
    return true;
  }

  /// Whether the line lays a bead.
  bool command(std::optional<RawBead>& bead) {
    std::string_view left = text_.substr(0, text_.find_first_of(";(*"));
    if (left.starts_with('N')) left.remove_prefix(std::min(left.find_first_of("GMT"), left.size()));  // a line's number
    if (left.empty() || (left.front() != 'G' && left.front() != 'M')) return false;
    const char letter = left.front();
    if (left.size() < 2 || left[1] < '0' || left[1] > '9') return false;
    left.remove_prefix(1);
    double code = 0;
    if (!number(left, code)) return false;
    if (letter == 'M') {
      if (code == 82) place_.relative_feed = false;
      if (code == 83) place_.relative_feed = true;
      return false;
    }
    if (code == 2 || code == 3) {
      fail("arcs (G2, G3) are not drawn; export it without arc fitting");
      return false;
    }
    if (code == 20) place_.unit = 25.4;
    if (code == 21) place_.unit = 1;
    if (code == 90) place_.relative = false;
    if (code == 91) place_.relative = true;
    if (code != 0 && code != 1 && code != 92) return false;

    double to[4];
    std::copy(std::begin(place_.at), std::end(place_.at), to);
    double fed = 0;
    while (!left.empty()) {
      const char axis = left.front();
      left.remove_prefix(1);
      if (axis == ' ' || axis == '\t') continue;
      if (axis < 'A' || axis > 'Z') {
        fail(fmt::format("'{}{}' is no word of a move", axis, one_line(left.substr(0, 20))));
        return false;
      }
      double value = 0;
      if (left.empty() || left.front() == ' ') continue;  // a word without a number, as G92 X
      if (!number(left, value)) return false;
      value *= place_.unit;
      constexpr std::string_view kAxes = "XYZE";
      const std::size_t k = kAxes.find(axis);
      if (k == std::string_view::npos) continue;
      const bool relative = code != 92 && (k == 3 ? place_.relative_feed : place_.relative);
      to[k] = relative ? place_.at[k] + value : value;
      if (k == 3 && code != 92) fed = to[k] - place_.at[k];
    }
    const double x = to[0] - place_.at[0], y = to[1] - place_.at[1];
    const bool lays = code != 92 && fed > 0 && (x != 0 || y != 0);
    if (lays) {
      for (const double at : {place_.at[0], place_.at[1], to[0], to[1], to[2]}) {
        if (!(std::abs(at) <= kFarthestMm)) {
          fail(fmt::format("a bead at {:g} mm; beds are at most {:g} mm wide", at, kFarthestMm));
          return false;
        }
      }
      bead = RawBead{{place_.at[0], place_.at[1]}, {to[0], to[1]}, to[2], fed, std::hypot(x, y)};
    }
    std::copy(std::begin(to), std::end(to), place_.at);
    return lays;
  }

  const std::string& path_;
  std::vector<std::string>& types_;
  FileReader& file_;
  std::string_view text_;
  Place place_, before_;
};

/// Width of a bead as high as its layer that holds what was fed; mm.
double width_of(const RawBead& bead, double height, double filament_mm) {
  const double section = bead.fed * std::numbers::pi * filament_mm * filament_mm / 4 / bead.length;
  const double width = section / height + height * (1 - std::numbers::pi / 4);
  return std::clamp(std::round(width * 100) / 100, 0.01, 20.0);
}

GcodeBead bead_of(const RawBead& raw, const Place& place, double filament_mm) {
  const double height = place.height > 0 ? place.height : raw.z > place.below ? raw.z - place.below : 0.2;
  const double width = place.width > 0 ? place.width : width_of(raw, height, filament_mm);
  const auto nm = [](double millimetres) { return static_cast<Nm>(nm_of(millimetres)); };
  return {{nm(raw.from[0]), nm(raw.from[1])}, {nm(raw.to[0]), nm(raw.to[1])}, nm(width), place.type};
}

}  // namespace

Result<GcodeFile> GcodeFile::open(const std::string& path) {
  auto reader = FileReader::open(path, kRules);
  return reader ? read(*reader) : Result<GcodeFile>(reader.error());
}

Result<GcodeFile> GcodeFile::read(FileReader& reader) {
  const std::string& path = reader.path();
  GcodeFile file;
  file.path_ = path;
  Walk walk(reader, file.types_);
  std::vector<Place> tags, rises;
  bool laid = false;
  double z = 0;
  std::optional<RawBead> raw;
  while (walk.next(raw)) {
    if (walk.layer_tag) {
      if (tags.empty()) file.box_ = Box();  // what start code lays belongs to no layer
      tags.push_back(walk.before());
      tags.back().below = z;
      continue;
    }
    if (!laid || raw->z != z) {
      rises.push_back(walk.before());
      rises.back().below = z;
    }
    laid = true;
    z = raw->z;
    Place place = walk.place();
    place.below = tags.empty() ? rises.back().below : tags.back().below;
    file.tells_widths_ |= place.width > 0;
    const GcodeBead bead = bead_of(*raw, place, file.filament_mm_);
    const Nm half = bead.width / 2, top = static_cast<Nm>(nm_of(raw->z));
    for (const Point2 end : {bead.from, bead.to}) {
      file.box_.add(Point3{end.x - half, end.y - half, top});
      file.box_.add(Point3{end.x + half, end.y + half, top});
    }
  }
  if (walk.fault) return Error{Fault::kUsage, *walk.fault};
  if (!laid || file.box_.empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}: no move in it lays filament; name a G-code file of an extrusion printer", path)};
  }
  if (walk.filament_mm > 0.1 && walk.filament_mm < 20) file.filament_mm_ = walk.filament_mm;
  file.layers_ = tags.empty() ? std::move(rises) : std::move(tags);
  return file;
}

Result<GcodeLayer> GcodeFile::layer(std::uint32_t index) const {
  if (index >= count()) return Error{Fault::kUsage, fmt::format("--layer {}: the file has layers 0 to {}", index, count() - 1)};
  std::vector<std::string> types = types_;
  const Error changed{Fault::kUsage, fmt::format("{}: has changed while it was drawn; draw it again", path_)};
  auto reader = FileReader::open(path_, kRules);
  if (!reader) return changed;
  Walk walk(*reader, types);
  walk.go_to(layers_[index]);
  const std::uint64_t end = index + 1 < count() ? layers_[index + 1].line : UINT64_MAX;
  GcodeLayer layer;
  std::optional<RawBead> raw;
  while (walk.next(raw)) {
    if (walk.before().line >= end) break;
    if (walk.layer_tag) continue;
    Place place = walk.place();
    place.below = layers_[index].below;
    if (layer.beads.empty()) layer.z = nm_of(raw->z);
    layer.beads.push_back(bead_of(*raw, place, filament_mm_));
  }
  if (walk.fault || types.size() != types_.size()) return changed;
  // A layer in which nothing is laid is where the nozzle is at its end.
  if (layer.beads.empty()) layer.z = nm_of(index + 1 < count() ? layers_[index + 1].at[2] : layers_[index].below);
  return layer;
}

}  // namespace lamina::read
