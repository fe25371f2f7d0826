#include "stages/formats/gcode/read_gcode.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "stages/formats/gcode/commands.h"
#include "stages/support/io/file_reader.h"

namespace lamina::formats {
namespace {

constexpr double kRound = 2 * std::numbers::pi;
constexpr double kAlmost = 0.02;    // rad: ends of beads are rounded to micrometres
constexpr double kJump = 0.1;       // mm of z without a bead that end a climb
constexpr double kTurnless = 5;     // mm of climb without a turn that are a layer
constexpr double kMinLayer = 0.04;  // mm: a slope that high leads to a new flat layer if a long flat way follows
constexpr double kMinRise = 0.02;   // mm from a layer to the next
constexpr double kSame = 1e-6;      // mm

double heading_of(const RawBead& bead) { return std::atan2(bead.to[1] - bead.from[1], bead.to[0] - bead.from[0]); }

constexpr double kUsualHeight = 0.2;  // mm, of a layer of which nothing is known
constexpr double kRoundSides = 1 - std::numbers::pi / 4;

/// mm3 of a fed unit: of a mm of filament, or of one that is counted in mm3.
double volume_of_unit(bool volumetric, double filament_mm) {
  return volumetric ? 1 : std::numbers::pi * filament_mm * filament_mm / 4;
}

/// The height of a bead, mm. layer_height, below  of GcodeFile::LayerPosition
double height_of(const RawBead& bead, double tag, double layer_height, double below) {
  if (tag > 0) return tag;
  if (layer_height > 0) return layer_height;
  if (!(bead.to[2] > below)) return kUsualHeight;
  // The start of a slope lies on the layer below: a bead of no height is as wide as the plane.
  return bead.from[2] == bead.to[2] ? bead.to[2] - below : std::max(bead.to[2] - below, 0.05);
}

/// Width of a rectangle with half circles at its sides that holds what was fed; mm.
double width_of(const RawBead& bead, double height, double unit_mm3) {
  const double width = bead.fed * unit_mm3 / bead.length() / height + height * kRoundSides;
  return std::clamp(std::round(width * 100) / 100, 0.01, 20.0);
}

/// Decides where layers begin. Takes the beads of a file in their order. See GcodeFile for the rules.
///
/// memory  200 bytes a layer
class LayerCutter {
 public:
  explicit LayerCutter(double layer_height_mm) : step_(layer_height_mm) {}

  struct CutLayer {
    GcodeFile::LayerPosition position;
    double low = 0, top = 0;                       // of the beads; top: of the highest end
    double length = 0, sloped = 0;                 // mm, all beads and those that climb or fall
    double untagged_length = 0, untagged_fed = 0;  // of beads without ;WIDTH:
    double turn = 0;                               // rad: of the direction of beads that climb
    double min_rise = 0;                           // mm between heights of flat beads, 0 if there is one height
    double tag_height = 0;                         // ;HEIGHT: of the last bead
    bool volumetric = false;                       // of the last bead
    bool turned = false;                           // ends with a turn
  };

  void tag(const GcodeFile::FilePosition& before) {
    if (!tagged_) layers_.clear();  // beads of start code belong to no layer
    tagged_ = true;
    if (step_ > 0) return;
    begin(before, false);
  }

  /// before  in front of the bead's line; now  behind it, for tags
  void add(const RawBead& bead, const GcodeFile::FilePosition& before, const GcodeFile::FilePosition& now) {
    if (step_ > 0) {
      if (bead.first && begins_step(bead)) begin(before, false);
    } else if (bead.first && !tagged_) {
      if (const Cut cut = cut_at(bead); cut != Cut::kNone) begin(before, cut == Cut::kClimb);
    }
    if (layers_.empty()) begin(before, false);
    CutLayer& layer = layers_.back();
    const double length = bead.length();
    const double low = std::min(bead.from[2], bead.to[2]), top = std::max(bead.from[2], bead.to[2]);
    layer.low = layer.position.beads == 0 ? low : std::min(layer.low, low);
    layer.top = layer.position.beads == 0 ? top : std::max(layer.top, top);
    ++layer.position.beads;
    layer.length += length;
    if (bead.from[2] != bead.to[2]) layer.sloped += length;
    if (now.width == 0) {
      layer.untagged_length += length;
      layer.untagged_fed += bead.fed;
    }
    const double rise = bead.from[2] - z_;
    if (rise > kMinRise && (layer.min_rise == 0 || rise < layer.min_rise)) layer.min_rise = rise;
    layer.tag_height = now.height;
    layer.volumetric = bead.volumetric;
    follow(bead);
  }

  /// Decides the heights of spirals. At least one bead must have been added.
  void finish() {
    if (step_ > 0) return finish_steps();
    double pitch = 0;
    for (CutLayer& layer : layers_) {
      if (!(layer.sloped > layer.length / 2)) {
        pitch = 0;
        continue;
      }
      // What is left of a climb behind its last turn is as high as that turn.
      if (layer.turned || (tagged_ && &layer != &layers_.back())) pitch = layer.top - layer.low;
      layer.position.height = pitch > 0.02 ? pitch : kUsualHeight;
    }
  }

  const std::vector<CutLayer>& layers() const { return layers_; }
  bool tagged() const { return tagged_; }
  std::size_t turns() const { return turns_; }        // layers that end with a turn
  std::size_t turnless() const { return turnless_; }  // layers that end after a climb without one

 private:
  enum class Cut { kNone, kLayer, kClimb };  // kClimb: a layer within a climb that continues
  /// Of the first bead of a line in a file without tags.
  Cut cut_at(const RawBead& bead) {
    if (layers_.empty()) return Cut::kLayer;
    const bool slope = bead.from[2] != bead.to[2];
    const double jump = std::abs(bead.from[2] - z_);
    if (!slope && (!climbs_ || jump > kSame)) return jump > kSame ? Cut::kLayer : Cut::kNone;
    if (!climbs_ || jump > kJump) return Cut::kLayer;
    const CutLayer& now = layers_.back();
    const bool flat = flat_length_ > 4 * slope_length_ && now.top - now.position.below >= kMinLayer;
    if (slope && flat) return Cut::kLayer;
    return ends_turn(bead) ? Cut::kClimb : Cut::kNone;
  }

  /// Layers by a given height hold several turns, or heights, or less than one.
  void finish_steps() {
    double climbed = 0, turned = 0;
    for (const CutLayer& layer : layers_) {
      if (!(layer.sloped > layer.length / 2)) continue;
      climbed += layer.top - layer.low;
      turned += std::abs(layer.turn);
    }
    const double pitch = turned >= kRound ? climbed / turned * kRound : step_;
    for (CutLayer& layer : layers_) {
      const bool climbs = layer.sloped > layer.length / 2;
      layer.position.height = climbs ? pitch : layer.min_rise > 0 ? layer.min_rise : step_;
    }
  }

  bool begins_step(const RawBead& bead) {
    const long step = std::lround(std::ceil((bead.from[2] + bead.to[2]) / 2 / step_ - kSame));
    const bool fell = step < last_step_ && bead.from[2] < z_ - kJump;  // the next part, or the next strand
    if (!layers_.empty() && step <= last_step_ && !fell) return false;
    last_step_ = step;
    return true;
  }

  /// A turn ends where the direction has gone round and the way leads away from where it began: outlines that wave go round
  /// early, and back.
  bool ends_turn(const RawBead& bead) {
    const double turned = std::abs(turned_ + std::remainder(heading_of(bead) - heading_, kRound));
    const bool away = std::hypot(bead.to[0] - seam_[0], bead.to[1] - seam_[1]) >=
                      std::hypot(bead.from[0] - seam_[0], bead.from[1] - seam_[1]);
    const bool turns = turned >= kRound - kAlmost && (away || turned >= 1.5 * kRound);
    if (!turns && bead.to[2] <= climb_from_ + kTurnless) return false;
    if (turns) turned_ -= std::copysign(kRound, turned_);
    layers_.back().turned = turns;
    ++(turns ? turns_ : turnless_);
    start_turn(bead);
    return true;
  }

  void start_turn(const RawBead& bead) {
    climb_from_ = bead.from[2];
    seam_[0] = bead.from[0];
    seam_[1] = bead.from[1];
  }

  void begin(const GcodeFile::FilePosition& before, bool climb_goes_on) {
    const double below = layers_.empty() ? 0 : layers_.back().top;
    layers_.emplace_back();
    layers_.back().position.start = before;
    layers_.back().position.below = below;
    layers_.back().low = layers_.back().top = below;  // of a layer without a bead
    climbs_ = climbs_ && climb_goes_on;
    slope_length_ = flat_length_ = 0;
  }

  /// Keeps what the next bead is compared with.
  void follow(const RawBead& bead) {
    const double heading = heading_of(bead), length = bead.length();
    if (climbs_) {
      const double turn = std::remainder(heading - heading_, kRound);
      turned_ += turn;
      layers_.back().turn += turn;
    }
    if (bead.from[2] != bead.to[2]) {
      if (!climbs_) {
        turned_ = 0;
        start_turn(bead);
      }
      climbs_ = true;
      slope_length_ += length;
      flat_length_ = 0;
    } else {
      flat_length_ += length;
    }
    heading_ = heading;
    z_ = bead.to[2];
  }

  const double step_;
  std::vector<CutLayer> layers_;
  bool tagged_ = false;
  std::size_t turns_ = 0, turnless_ = 0;
  // The bead before, and the climb that it belongs to.
  double z_ = 0, heading_ = 0;
  bool climbs_ = false;                        // the climb has begun
  double turned_ = 0;                          // radians since the last turn of the climb
  double climb_from_ = 0;                      // z at which the turn, or the climb without one, began
  double seam_[2] = {};                        // x, y there
  double slope_length_ = 0, flat_length_ = 0;  // of the layer's slopes, and of the beads behind the last one
  long last_step_ = 0;
};

constexpr double kUsualNozzle = 0.4;  // mm

constexpr ReadRules kRules{.fault = Fault::kUsage,
                           .missing = "cannot be read; give a directory of a job or a G-code file",
                           .longest_line = 16 << 20,  // pictures in comments
                           .cr_ends = true};

/// In the order of Difference.
constexpr std::string_view kDifferenceTexts[] = {
    "lower-case letters, which Marlin reads only if built with GCODE_CASE_INSENSITIVE",
    "a blank in front of a number, which Marlin and Klipper skip, but RepRapFirmware may not",
    "comments in parentheses, skipped; Klipper refuses them, Marlin skips them if built with PAREN_COMMENTS, RepRapFirmware in "
    "CNC mode",
    "E directly behind a digit begins a word, as in Marlin and Klipper; RepRapFirmware reads an exponent",
    "a letter twice in a command; the last one is used, as in Klipper, and in RepRapFirmware the first",
    "CR alone ends lines, as in Marlin; Klipper and RepRapFirmware need LF",
    "words without a command repeat the last move, as in Marlin built with GCODE_MOTION_MODES and RepRapFirmware in CNC mode; "
    "Klipper refuses them",
    "several commands in a line are all run, as in RepRapFirmware; Marlin and Klipper run one",
    "M221 without S changes nothing, as in Marlin and RepRapFirmware; Klipper returns to 100 %",
    "M221 is of one tool, as in Marlin and RepRapFirmware; Klipper has one percentage for all tools",
    "begins as a move without a command and is text; left out, as in Klipper and in Marlin built without GCODE_MOTION_MODES"};
static_assert(std::size(kDifferenceTexts) == static_cast<std::size_t>(Difference::kCount));

GcodeBead bead_of(const RawBead& raw, double width_mm, std::uint32_t type) {
  const auto nm = [](double millimetres) { return static_cast<Nm>(nm_of(millimetres)); };
  return {{nm(raw.from[0]), nm(raw.from[1])}, {nm(raw.to[0]), nm(raw.to[1])}, std::max<Nm>(nm(width_mm), 1), type};
}

/// Why a file is not text, if its first bytes show it.
std::string_view binary_kind(const FileReader& reader) {
  std::array<char, 4> magic{};
  if (!reader.read_at(0, magic)) return {};
  const std::string_view text(magic.data(), magic.size());
  if (text == "GCDE") {  // prusa3d/libbgcode, doc/specifications.md
    return "is binary G-code; make text of it with `bgcode FILE` (package bgcode, prusa3d/libbgcode), or switch \"binary G-code\" "
           "off in the slicer's printer settings";
  }
  if (text == std::string_view("PK\3\4", 4)) {
    return "is a zip archive, as .gcode.3mf of BambuStudio and Orca; draw the G-code in it: unzip FILE Metadata/plate_1.gcode";
  }
  return {};
}

std::string odd_lines(const OddLines& arcs, std::string_view what) {
  const std::string others = arcs.count > 1 ? fmt::format(" and {} more", arcs.count - 1) : "";
  return fmt::format("line {}{}: {}", arcs.line, others, what);
}

}  // namespace

/// Reads a file from its start to its end, once.
class GcodeSurvey {
 public:
  GcodeSurvey(FileReader& reader, const GcodeOptions& options)
      : options_(options), walk_(reader, file_.types_), cutter_(options.layer_height_mm) {
    file_.path_ = reader.path();
  }
  Result<GcodeFile> run();

 private:
  Status read_all();
  Status check_limits() const;
  void add_to_box(const RawBead& raw);
  void add_dynamics(const RawBead& raw);
  void take_filament();
  void note_widths();
  void note_climbs();
  void note_arcs();
  void note_feeds();
  double mean_width() const;

  const GcodeOptions options_;
  GcodeFile file_;
  GcodeCommands walk_;
  LayerCutter cutter_;
  std::array<double, 2> fed_{};  // by all beads: mm of filament, mm3
  double speed_ = 0;             // mm/s, of the bead before
};

void GcodeSurvey::add_to_box(const RawBead& raw) {
  const GcodeFile::FilePosition& position = walk_.position();
  const bool slope = raw.from[2] != raw.to[2];  // the pitch of a climb is not known yet
  const double below = slope ? raw.to[2] : cutter_.layers().back().position.below;
  const double height = height_of(raw, position.height, 0, below);
  const double unit = volume_of_unit(raw.volumetric, file_.filament_mm_);
  const GcodeBead bead = bead_of(raw, position.width > 0 ? position.width : width_of(raw, height, unit), position.type);
  const Nm half = bead.width / 2, top = static_cast<Nm>(nm_of(raw.to[2]));
  const auto moved = [](Nm at, std::int64_t by) {
    return static_cast<Nm>(std::clamp<std::int64_t>(at + by, -kNmReach, kNmReach));
  };
  for (const Point2 end : {bead.from, bead.to}) {
    file_.box_.add(Point3{moved(end.x, -half), moved(end.y, -half), top});
    file_.box_.add(Point3{moved(end.x, half), moved(end.y, half), top});
  }
}

void GcodeSurvey::add_dynamics(const RawBead& raw) {
  auto& [low, high] = file_.accelerations_;
  if (raw.acceleration > 0) {
    low = low > 0 ? std::min(low, raw.acceleration) : raw.acceleration;
    high = std::max(high, raw.acceleration);
  }
  ++file_.beads_;
  file_.speed_changes_ += raw.joined && raw.speed != speed_ ? 1 : 0;
  speed_ = raw.speed;
}

Status GcodeSurvey::check_limits() const {
  const std::vector<LayerCutter::CutLayer>& layers = cutter_.layers();
  if (layers.size() > options_.max_layers) {
    return Error{Fault::kUsage, fmt::format("{}: line {}: more than {} layers; --layer-height MM cuts thicker ones",
                                            file_.path_, walk_.position().line, options_.max_layers)};
  }
  if (!layers.empty() && layers.back().position.beads > options_.max_beads) {
    return Error{Fault::kUsage,
                 fmt::format("{}: line {}: a layer of more than {} beads; --layer-height MM makes thinner layers", file_.path_,
                             walk_.position().line, options_.max_beads)};
  }
  return {};
}

Status GcodeSurvey::read_all() {
  std::optional<RawBead> raw;
  while (walk_.next(raw)) {
    if (walk_.layer_tag) {
      if (!cutter_.tagged()) {  // beads of start code belong to no layer
        file_.box_ = Box(), fed_ = {};
        file_.accelerations_ = {}, file_.beads_ = file_.speed_changes_ = 0;
      }
      cutter_.tag(walk_.before());
    } else {
      cutter_.add(*raw, walk_.before(), walk_.position());
      file_.states_widths_ |= walk_.position().width > 0;
      add_to_box(*raw);
      fed_[raw->volumetric ? 1 : 0] += raw->fed;
      add_dynamics(*raw);
    }
    if (Status status = check_limits(); !status) return status;
  }
  if (walk_.fault) return Error{Fault::kUsage, *walk_.fault};
  if (file_.box_.empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}: no move extrudes filament; give a G-code file of an extrusion printer", file_.path_)};
  }
  return {};
}

void GcodeSurvey::take_filament() {
  const SlicerFacts& facts = walk_.facts;
  file_.states_filament_ = facts.filament_mm > 0;
  if (facts.filament_mm > 0) file_.filament_mm_ = facts.filament_mm;
  if (options_.filament_mm > 0) file_.filament_mm_ = options_.filament_mm;
  file_.volumetric_ = facts.volumetric;
  file_.machine_ = facts.machine;
  file_.density_g_cm3_ = facts.density_g_cm3;
  file_.fed_mm3_ = fed_[0] * volume_of_unit(facts.volumetric, file_.filament_mm_) + fed_[1];
}

/// Over the length of all beads whose widths no tag states; 0 if there is none.
double GcodeSurvey::mean_width() const {
  double area = 0, length = 0;
  for (const LayerCutter::CutLayer& layer : cutter_.layers()) {
    const auto& [start, below, height, beads] = layer.position;
    const double own = layer.top > below ? layer.top - below : kUsualHeight;
    const double h = layer.tag_height > 0 ? layer.tag_height : height > 0 ? height : own;
    const double unit = volume_of_unit(layer.volumetric || file_.volumetric_, file_.filament_mm_);
    area += layer.untagged_fed * unit / h + layer.untagged_length * h * kRoundSides;
    length += layer.untagged_length;
  }
  return length > 0 ? area / length : 0;
}

void GcodeSurvey::note_widths() {
  const double width = mean_width(), reported = walk_.facts.nozzle_mm, nozzle = reported > 0 ? reported : kUsualNozzle;
  if (width == 0 || width >= nozzle / 2) return;
  const bool given = options_.filament_mm > 0;
  file_.notes_.push_back(
      fmt::format("beads are {:.2f} mm wide on average by filament of {:g} mm{}, less than half of a nozzle of {:g} mm; {}",
                  width, file_.filament_mm_, given || file_.states_filament_ ? "" : ", of which the file says nothing", nozzle,
                  given ? "check --filament" : "if the filament is another, name it by --filament MM, as 2.85"));
}

void GcodeSurvey::note_climbs() {
  if (cutter_.tagged() || options_.layer_height_mm > 0) return;
  if (cutter_.turns() > 0) {
    file_.notes_.emplace_back("beads climb in a spiral: layers are its turns; --layer-height MM cuts it by height");
  }
  if (cutter_.turnless() > 0) {
    file_.notes_.emplace_back("beads climb without a turn: layers are 5 mm high; --layer-height MM makes them thinner");
  }
}

void GcodeSurvey::note_arcs() {
  if (walk_.left_out.count > 0) {
    file_.notes_.push_back(odd_lines(walk_.left_out,
                                     "an arc without a centre (I, J, R) or a way, left out as Marlin does; Klipper "
                                     "and RepRapFirmware stop there"));
  }
  if (walk_.short_radius.count > 0) {
    file_.notes_.push_back(odd_lines(walk_.short_radius,
                                     "an arc whose R does not reach its end, drawn as half a circle, as Marlin "
                                     "does; RepRapFirmware stops there"));
  }
  if (walk_.off_circle.count > 0) {
    file_.notes_.push_back(
        odd_lines(walk_.off_circle, "an arc that ends off its circle, led to its end by a line, as Marlin does"));
  }
}

void GcodeSurvey::note_feeds() {
  for (std::size_t k = 0; k < std::size(kDifferenceTexts); ++k) {
    if (walk_.differences[k].count > 0) file_.notes_.push_back(odd_lines(walk_.differences[k], kDifferenceTexts[k]));
  }
  if (walk_.flows.count > 0) {
    file_.notes_.push_back(
        odd_lines(walk_.flows, fmt::format("M221 S{:g} is applied: volumes are that percentage of E{}", walk_.flow,
                                           file_.states_widths_ ? "; widths of ;WIDTH: tags do not include it" : "")));
  }
  const bool by_g90 = walk_.unfed_after_g90.count > walk_.moves_with_e / 4;
  if (!by_g90 && walk_.unfed.count <= walk_.moves_with_e / 2) return;
  const OddLines& lines = by_g90 ? walk_.unfed_after_g90 : walk_.unfed;
  file_.notes_.push_back(fmt::format(
      "line {}: {} of {} moves with E feed nothing; {}", lines.line, lines.count, walk_.moves_with_e,
      by_g90 ? "by ;FLAVOR:Marlin, G90 makes E absolute after M83: if the firmware is another, correct that line, or "
               "write M83 behind G90"
             : "check M82 and M83: E is read as absolute there"));
}

Result<GcodeFile> GcodeSurvey::run() {
  if (Status status = read_all(); !status) return status.error();
  cutter_.finish();
  take_filament();
  for (const LayerCutter::CutLayer& layer : cutter_.layers()) file_.layers_.push_back(layer.position);
  note_widths();
  note_climbs();
  note_arcs();
  note_feeds();
  return std::move(file_);
}

Result<FileReader> open_gcode(const std::string& path) {
  auto reader = FileReader::open(path, kRules);
  if (!reader) return reader;
  if (const std::string_view kind = binary_kind(*reader); !kind.empty())
    return Error{Fault::kUsage, fmt::format("{}: {}", path, kind)};
  return reader;
}

Result<GcodeFile> GcodeFile::open(const std::string& path, const GcodeOptions& options) {
  auto reader = FileReader::open(path, kRules);
  return reader ? read(*reader, options) : Result<GcodeFile>(reader.error());
}

Result<GcodeFile> GcodeFile::read(FileReader& reader, const GcodeOptions& options) {
  if (const std::string_view kind = binary_kind(reader); !kind.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: {}", reader.path(), kind)};
  }
  return GcodeSurvey(reader, options).run();
}

Result<GcodeLayer> GcodeFile::layer(std::uint32_t index, bool with_feeds) const {
  if (index >= count()) return Error{Fault::kUsage, fmt::format("--layer {}: the file has layers 0 to {}", index, count() - 1)};
  std::vector<std::string> types = types_;
  const Error changed{Fault::kUsage, fmt::format("{}: has changed while it was drawn; draw it again", path_)};
  auto reader = FileReader::open(path_, kRules);
  if (!reader) return changed;
  const LayerPosition& position = layers_[index];
  GcodeCommands walk(*reader, types);
  walk.go_to(position.start);
  GcodeLayer layer;
  layer.beads.reserve(position.beads);
  std::optional<RawBead> raw;
  while (layer.beads.size() < position.beads && walk.next(raw)) {
    if (walk.layer_tag) continue;
    if (layer.beads.empty()) layer.z = nm_of(raw->to[2]);
    const FilePosition& now = walk.position();
    const double unit = volume_of_unit(raw->volumetric || volumetric_, filament_mm_);
    const double width = width_of(*raw, height_of(*raw, now.height, position.height, position.below), unit);
    layer.beads.push_back(bead_of(*raw, now.width > 0 ? now.width : width, now.type));
    if (with_feeds) layer.feeds.push_back({raw->fed * unit, raw->speed, raw->joined, raw->primed * unit, raw->acceleration});
  }
  if (walk.fault || types.size() != types_.size() || layer.beads.size() != position.beads) return changed;
  // A layer without a bead is at the height of the nozzle at its end.
  if (layer.beads.empty()) layer.z = nm_of(index + 1 < count() ? layers_[index + 1].start.at[2] : position.below);
  return layer;
}

}  // namespace lamina::formats
