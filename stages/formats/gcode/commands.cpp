#include "stages/formats/gcode/commands.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

constexpr std::size_t kMaxProfile = 64 << 10;  // bytes of settings; Cura's are some 5 kB

/// The number at the beginning of a text, blanks passed over; 0 if there is none.
double leading_number(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// The letters of a setting's name, lower case, up to what separates it from its value.
struct SettingLine {
  std::array<char, 40> letters{};
  std::size_t size = 0;
  std::string_view value;

  explicit SettingLine(std::string_view comment) {
    for (std::size_t i = 1; i < comment.size(); ++i) {
      const char c = comment[i];
      if (c == '#') {  // ideaMaker: "Filament Diameter #1: 1.75"
        value = comment.substr(std::min(comment.find(':', i), comment.size() - 1) + 1);
        return;
      }
      if (c == '=' || c == ':' || c == ',') {
        value = comment.substr(i + 1);
        return;
      }
      const bool upper = c >= 'A' && c <= 'Z';
      if (!upper && !(c >= 'a' && c <= 'z')) continue;
      if (size == letters.size()) break;
      letters[size++] = upper ? static_cast<char>(c + 32) : c;
    }
    size = 0;
  }
  std::string_view name() const { return {letters.data(), size}; }
};

std::string decode_base64(std::string_view text) {
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                                             : -1;
    if (value < 0) break;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes.push_back(static_cast<char>(bits >> held & 0xff));
  }
  return bytes;
}

/// What a zlib stream begins with, kMaxProfile bytes at most; empty if it is none.
std::string inflated(std::string& bytes) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return {};
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::string text(kMaxProfile, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(text.data());
  stream.avail_out = static_cast<uInt>(text.size());
  const int status = inflate(&stream, Z_FINISH);
  if (status != Z_STREAM_END && status != Z_OK && status != Z_BUF_ERROR) return {};
  text.resize(text.size() - stream.avail_out);
  return text;
}

}  // namespace

double cura_profile_number(std::string_view base64, std::string_view setting) {
  std::string bytes = decode_base64(base64);
  const std::string text = inflated(bytes);
  const std::string key = std::string(setting) + '=';  // settings are parted by \b, the first has nothing before it
  for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + 1)) {
    const bool whole = at == 0 || static_cast<unsigned char>(text[at - 1]) < ' ';
    if (whole) return leading_number(std::string_view(text).substr(at + key.size()));
  }
  return 0;
}

void SlicerFacts::state_filament(double diameter_mm, DiameterSource source) {
  if (!(diameter_mm > 0.1 && diameter_mm < 20) || source <= source_) return;
  filament_mm = diameter_mm;
  source_ = source;
}

void SlicerFacts::state_density(double g_cm3) {
  if (density_g_cm3 == 0 && g_cm3 > 0.1 && g_cm3 < 25) density_g_cm3 = g_cm3;
}

void SlicerFacts::read_flavor(std::string_view flavor) {
  // Cura: gcodeExport.cpp, GCodeExport::setFlavor(): these two count E in mm3.
  if (flavor.starts_with("UltiGCode") || flavor.starts_with("Marlin(Volumetric)")) volumetric = true;
  if (flavor.starts_with("Griffin")) state_filament(2.85, DiameterSource::kFlavor);
}

void SlicerFacts::read_weight(std::string_view used) {
  const std::size_t metre = used.find("m "), gram = used.find('g');
  if (metre == std::string_view::npos || gram == std::string_view::npos || gram < metre) return;
  const double metres = leading_number(used), grams = leading_number(used.substr(metre + 2));
  if (!(metres > 0 && grams > 0)) return;
  // Plastics for filament weigh 0.9 to 1.4 g/cm3: 2.2 to 3.4 g a metre of 1.75 mm, 5.7 to 8.9 g of 2.85 mm.
  const double weight = grams / metres;
  if (weight > 2 && weight < 4) state_filament(1.75, DiameterSource::kWeight);
  if (weight > 5 && weight < 10) state_filament(2.85, DiameterSource::kWeight);
}

void SlicerFacts::read_setting(std::string_view comment) {
  const SettingLine line(comment);
  const std::string_view name = line.name();
  if (name == "filamentdiameter" || name == "filamentdiameters" || name == "fiberdiamm" || name == "materialdiameter") {
    state_filament(leading_number(line.value), DiameterSource::kSetting);
  }
  if (name == "nozzlediameter" || name == "extruderdiameter" || name == "extrudertrainnozzlediameter") {
    const double diameter = leading_number(line.value);
    if (nozzle_mm == 0 && diameter > 0.05 && diameter < 10) nozzle_mm = diameter;
  }
  if (name == "filamentdensity" && !density_set_) {
    density_g_cm3 = 0;  // what is set goes before what was weighed
    state_density(leading_number(line.value));
    density_set_ = density_g_cm3 > 0;
  }
  if (name == "filamentusedcm") used_cm3_ = leading_number(line.value);
  if (name == "filamentusedg" && used_cm3_ >= 0.2)  // stated to 0.01
    state_density(leading_number(line.value) / used_cm3_);
  if (name == "usevolumetrice" && leading_number(line.value) == 1) volumetric = true;
}

void SlicerFacts::read(std::string_view comment) {
  constexpr std::string_view kProfile = ";CURA_PROFILE_STRING:", kFlavor = ";FLAVOR:", kUsed = ";Filament used:";
  constexpr std::string_view kMachine = "; machine: ";
  constexpr std::string_view kCuraSettings = ";SETTING_3 ", kMaterial = "material_diameter = ";
  if (comment.starts_with(kProfile)) {
    if (source_ < DiameterSource::kProfile) {
      const std::string_view profile = comment.substr(kProfile.size());
      state_filament(cura_profile_number(profile, "filament_diameter"), DiameterSource::kProfile);
    }
  } else if (comment.starts_with(kFlavor)) {
    read_flavor(comment.substr(kFlavor.size()));
  } else if (comment.starts_with(kUsed)) {
    read_weight(comment.substr(kUsed.size()));
  } else if (comment.starts_with(kMachine)) {
    if (machine.empty()) machine = comment.substr(kMachine.size(), 100);
  } else if (comment.starts_with(kCuraSettings)) {
    const std::size_t at = comment.find(kMaterial);
    if (at != std::string_view::npos)
      state_filament(leading_number(comment.substr(at + kMaterial.size())), DiameterSource::kProfile);
  } else {
    for (const std::string_view sign : {"iameter", "IAMETER", "fiber_dia", "volumetric_e", "_density", "ment used ["}) {
      if (comment.find(sign) != std::string_view::npos) return read_setting(comment);
    }
  }
}

namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kNear = 1e-6;                         // mm or radians: NEAR() and NEAR_ZERO() of Marlin
constexpr double kDeviation = Arc::kTolerance - 1e-5;  // leaves room for ends on whole nanometres
constexpr double kLongest = 1e150;                     // mm: a radius that can be squared
constexpr double kMaxChords = 1e9;                     // of an arc that leaves every bed with its first one

}  // namespace

bool Arc::plan(ArcPoint from, ArcPoint to, const ArcWords& words) {
  from_ = from;
  to_ = to;
  short_radius_ = false;
  const double dx = to.x - from.x, dy = to.y - from.y;
  double i = words.i, j = words.j;
  if (words.radius) {
    const double r = *words.radius, half = std::hypot(dx, dy) / 2;
    if (r == 0 || half == 0) return false;
    const double height = std::sqrt(std::max(0.0, (r - half) * (r + half)));
    const double side = words.clockwise != (r < 0) ? -1 : 1;
    i = dx / 2 - dy / 2 / half * side * height;
    j = dy / 2 + dx / 2 / half * side * height;
    short_radius_ = std::abs(r) < 0.99 * half;
  }
  if (i == 0 && j == 0) return false;
  spoke_ = {-i, -j};

  // The spoke of the end is that of the start plus the way: written so, long radii cost no digits.
  const double radius = std::hypot(i, j);
  if (!(radius < kLongest)) return false;
  const double along = spoke_.x * dx + spoke_.y * dy, across = spoke_.x * dy - spoke_.y * dx;
  const double angle = std::atan2(across, radius * radius + along);
  const bool near = std::abs(dx) <= kNear && std::abs(dy) <= kNear;
  travel_ = angle;
  if (words.clockwise ? angle > 0 : angle < 0) travel_ += words.clockwise ? -kTurn : kTurn;
  if (words.clockwise ? angle == 0 : std::abs(angle) < kNear && near) travel_ = words.clockwise ? -kTurn : kTurn;
  if (words.clockwise && near && std::abs(travel_) < kNear) travel_ = -kTurn;
  if (travel_ == 0) return false;

  miss_ = std::abs(2 * along + dx * dx + dy * dy) / (std::hypot(spoke_.x + dx, spoke_.y + dy) + radius);
  const double step = std::min(4 * std::asin(std::sqrt(std::min(1.0, kDeviation / (2 * radius)))), kTurn / 4);
  chords_ = static_cast<std::uint64_t>(std::clamp(std::ceil(std::abs(travel_) / step), 1.0, kMaxChords));
  return true;
}

Arc::ArcPoint Arc::end_of(std::uint64_t chord) const {
  if (chord >= chords_) return to_;
  const double angle = travel_ * static_cast<double>(chord) / static_cast<double>(chords_);
  const double half = std::sin(angle / 2), sine = std::sin(angle), fall = -2 * half * half;  // cos - 1
  return {from_.x + fall * spoke_.x - sine * spoke_.y, from_.y + sine * spoke_.x + fall * spoke_.y};
}

namespace {

constexpr double kFarthestMm = 2000;

/// What a line says behind one of the tags; null if it has none of them. BambuStudio has tags of its own:
/// bambulab/BambuStudio, src/libslic3r/GCode/GCodeProcessor.cpp, Reserved_Tags.
std::optional<std::string_view> behind_tag(std::string_view line, std::string_view tag, std::string_view bambu) {
  if (line.starts_with(tag)) return line.substr(tag.size());
  if (line.starts_with(bambu)) return line.substr(bambu.size());
  return std::nullopt;
}

/// CuraEngine's words: gcodeExport.cpp, GCodeExport::flavorToString().
GcodeFile::Firmware firmware_of(std::string_view flavor) {
  if (flavor.starts_with("Marlin")) return GcodeFile::Firmware::kMarlin;
  return flavor.starts_with("RepRap") ? GcodeFile::Firmware::kRepRap : GcodeFile::Firmware::kUnknown;
}

}  // namespace

double RawBead::length() const { return std::hypot(to[0] - from[0], to[1] - from[1]); }

bool GcodeCommands::next(std::optional<RawBead>& bead) {
  bead.reset();
  layer_tag = false;
  while (!fault) {
    if (chord_ > 0) {
      if (next_chord(bead)) return true;
    } else if (!read_line()) {
      return false;
    } else if (text_.starts_with(';') ? read_tag() : run_command(bead)) {
      return true;
    }
  }
  return false;
}

bool GcodeCommands::read_line() {
  before_ = position_;
  const bool read = file_.next(text_);
  position_.line += read || !file_.status() ? 1 : 0;
  position_.byte = file_.offset();
  if (!file_.status()) return fail("is no text of G-code; name a file that lamina extrude or a slicer wrote"), false;
  if (!read) return false;
  while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\t')) text_.remove_prefix(1);
  if (text_.ends_with('\r')) text_.remove_suffix(1);
  return true;
}

void GcodeCommands::fail(std::string_view what) { fault = fmt::format("{}: line {}: {}", path_, position_.line, what); }

double GcodeCommands::tag_length(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || !(value >= 0 && value < kFarthestMm)) {
    fail(fmt::format("'{}' is not a length", one_line(text.substr(0, 40))));
    return 0;
  }
  return value;
}

void GcodeCommands::name_type(std::string_view text) {
  const std::string name = one_line(text.substr(0, 40));
  const auto known = std::ranges::find(types_, name);
  position_.type = static_cast<std::uint32_t>(known - types_.begin());
  if (known == types_.end() && types_.size() < 100) types_.push_back(name);
  position_.type = std::min<std::uint32_t>(position_.type, static_cast<std::uint32_t>(types_.size() - 1));
}

bool GcodeCommands::read_tag() {
  for (const std::string_view tag : {";LAYER_CHANGE", ";LAYER:", "; CHANGE_LAYER"}) {
    if (text_.starts_with(tag)) return layer_tag = true;
  }
  if (const auto width = behind_tag(text_, ";WIDTH:", "; LINE_WIDTH:")) {
    position_.width = tag_length(*width);
  } else if (const auto height = behind_tag(text_, ";HEIGHT:", "; LAYER_HEIGHT:")) {
    position_.height = tag_length(*height);
  } else if (const auto type = behind_tag(text_, ";TYPE:", "; FEATURE: ")) {
    name_type(*type);
  } else {
    if (text_.starts_with(";FLAVOR:")) position_.firmware = firmware_of(text_.substr(8));
    facts.read(text_);
  }
  return false;
}

/// The number behind a letter; moves behind it.
bool GcodeCommands::read_number(std::string_view& left, double& value) {
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

bool GcodeCommands::read_words(std::string_view left, Words& words) {
  while (!left.empty()) {
    const char letter = left.front();
    left.remove_prefix(1);
    if (letter == ' ' || letter == '\t') continue;
    if (letter < 'A' || letter > 'Z') {
      fail(fmt::format("'{}{}' is no word of a move", letter, one_line(left.substr(0, 20))));
      return false;
    }
    if (left.empty() || left.front() == ' ') continue;  // a word without a number, as G92 X
    if (!read_number(left, words.value[letter - 'A'])) return false;
    words.given |= 1u << (letter - 'A');
  }
  return true;
}

/// Marlin's G90 and G91 replace what M82 and M83 said (MarlinFirmware/Marlin, GcodeSuite::set_relative_mode()).
void GcodeCommands::set_relative(bool relative) {
  position_.relative = relative;
  if (position_.firmware == GcodeFile::Firmware::kMarlin) position_.relative_feed = relative;
}

/// Of E. G91 or M83 makes it relative in Klipper (klippy/extras/gcode_move.py, GCodeMove.cmd_G1) and in PrusaSlicer's view
/// of its own files (GCodeProcessor::process_G1); in RepRapFirmware M83 alone does.
bool GcodeCommands::feeds_relative() const {
  return position_.relative_feed || (position_.relative && position_.firmware == GcodeFile::Firmware::kUnknown);
}

/// Whether the line is no move.
bool GcodeCommands::set_mode(char letter, double code, std::string_view left) {
  if (letter == 'M') {
    if (code == 82) position_.relative_feed = false;
    if (code == 83) position_.relative_feed = true;
    Words words;
    if (code == 200 && read_words(left, words)) {  // Marlin: M200 D1.75 counts E in mm3, M200 D0 or S0 does not
      if (words.has('D')) position_.volumetric = words['D'] > 0;
      if (words.has('S')) position_.volumetric = words['S'] != 0;
    }
    return true;
  }
  if (code == 17 || code == 18 || code == 19) position_.plane = static_cast<std::uint8_t>(code);
  if (code == 20) position_.unit = 25.4;
  if (code == 21) position_.unit = 1;
  if (code == 90 || code == 91) set_relative(code == 91);
  if (code == 90.1) fail("G90.1: firmwares of printers take centres of arcs from the start; export them so");
  if (code == 5) fail("splines (G5) are not drawn; export lines or arcs");
  return code != 0 && code != 1 && code != 2 && code != 3 && code != 92;
}

/// Whether the line deposits a bead.
bool GcodeCommands::run_command(std::optional<RawBead>& bead) {
  std::string_view left = text_.substr(0, text_.find_first_of(";(*"));
  if (left.starts_with('N')) left.remove_prefix(std::min(left.find_first_of("GMT"), left.size()));  // a line's number
  if (left.empty() || (left.front() != 'G' && left.front() != 'M')) return false;
  const char letter = left.front();
  if (left.size() < 2 || left[1] < '0' || left[1] > '9') return false;
  left.remove_prefix(1);
  double code = 0;
  if (!read_number(left, code) || set_mode(letter, code, left)) return false;
  Words words;
  return read_words(left, words) && move(code, words, bead);
}

bool GcodeCommands::within_reach(const RawBead& bead) {
  for (const double at : {bead.from[0], bead.from[1], bead.from[2], bead.to[0], bead.to[1], bead.to[2]}) {
    if (std::abs(at) <= kFarthestMm) continue;
    fail(fmt::format("a bead at {:g} mm; beds are at most {:g} mm wide", at, kFarthestMm));
    return false;
  }
  return true;
}

bool GcodeCommands::move(double code, const Words& words, std::optional<RawBead>& bead) {
  constexpr char kAxes[] = {'X', 'Y', 'Z', 'E'};
  double to[4];
  for (std::size_t k = 0; k < 4; ++k) {
    const bool relative = code != 92 && (k == 3 ? feeds_relative() : position_.relative);
    to[k] = position_.at[k];
    if (words.has(kAxes[k])) to[k] = (relative ? position_.at[k] : 0) + words[kAxes[k]] * position_.unit;
  }
  const double fed = code != 92 ? to[3] - position_.at[3] : 0;
  if (code != 92 && words.has('F')) position_.speed = std::max(words['F'] * position_.unit / 60, 0.0);
  const bool joined = position_.deposits;
  if (code != 92) position_.deposits = position_.deposits && std::equal(std::begin(to), std::end(to), position_.at);
  if (code == 2 || code == 3) {
    if (!begin_arc(code == 2, words, to, fed)) return false;
    whole_.joined = joined;
    whole_.primed = position_.primed;
    position_.deposits = chord_ > 0;
    position_.primed = chord_ > 0 ? 0 : position_.primed + fed;
  } else if (fed > 0 && (to[0] != position_.at[0] || to[1] != position_.at[1])) {
    const double* at = position_.at;
    bead = RawBead{{at[0], at[1], at[2]},
                   {to[0], to[1], to[2]},
                   fed,
                   position_.volumetric,
                   position_.speed,
                   joined,
                   position_.primed,
                   true};
    if (!within_reach(*bead)) return false;
    position_.deposits = true;
    position_.primed = 0;
  } else {
    position_.primed += fed;
  }
  std::copy(std::begin(to), std::end(to), position_.at);
  return bead.has_value() || (chord_ > 0 && next_chord(bead));
}

/// False if the printer does not move.
bool GcodeCommands::begin_arc(bool clockwise, const Words& words, const double (&to)[4], double fed) {
  const double* at = position_.at;
  ArcWords given{clockwise, words['I'] * position_.unit, words['J'] * position_.unit, {}};
  if (words.has('R')) given.radius = words['R'] * position_.unit;
  const bool deposits = fed > 0;
  if (position_.plane != 17) {
    // G18 leads Z to X in RepRapFirmware (GCodes::DoArcMove) and Marlin, X to Z in Klipper: the other way round.
    if (deposits)
      fail(fmt::format("an arc in the plane of G{}: firmwares differ; export arcs in that of the bed (G17)", position_.plane));
    return !deposits;
  }
  if (!arc_.plan({at[0], at[1]}, {to[0], to[1]}, given)) {
    left_out.add(position_.line);
    return false;
  }
  if (!deposits) return true;
  if (words['P'] != 0) {
    fail("an arc of several turns (P), which firmwares read by request only; export each turn");
    return false;
  }
  if (arc_.miss() > 0.05) off_circle.add(position_.line);
  if (arc_.radius_short()) short_radius.add(position_.line);
  whole_ = {{at[0], at[1], at[2]}, {to[0], to[1], to[2]}, fed, position_.volumetric, position_.speed, false, 0, true};
  chord_ = 1;
  return true;
}

/// The chord whose number is chord_, if it is longer than nothing.
bool GcodeCommands::next_chord(std::optional<RawBead>& bead) {
  const auto z_of = [&](std::uint64_t chord) {
    const double share = static_cast<double>(chord) / static_cast<double>(arc_.chords());
    return chord == arc_.chords() ? whole_.to[2] : whole_.from[2] + share * (whole_.to[2] - whole_.from[2]);
  };
  const Arc::ArcPoint from = chord_ == 1 ? Arc::ArcPoint{whole_.from[0], whole_.from[1]} : arc_.end_of(chord_ - 1);
  const Arc::ArcPoint to = arc_.end_of(chord_);
  const double fed = whole_.fed / static_cast<double>(arc_.chords());
  RawBead piece{{from.x, from.y, z_of(chord_ - 1)},
                {to.x, to.y, z_of(chord_)},
                fed,
                whole_.volumetric,
                whole_.speed,
                whole_.joined,
                whole_.primed,
                whole_.first};
  chord_ = chord_ < arc_.chords() ? chord_ + 1 : 0;
  if (from.x == to.x && from.y == to.y) return false;
  whole_.first = false;
  whole_.joined = true;
  whole_.primed = 0;
  if (!within_reach(piece)) return false;
  bead = piece;
  return true;
}

}  // namespace lamina::formats
