#include "stages/formats/gcode/commands.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

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

/// CuraEngine's words: gcodeExport.cpp, GCodeExport::flavorToString(); Klipper is none of them.
GcodeFile::Firmware firmware_of(std::string_view flavor) {
  if (flavor.starts_with("Marlin")) return GcodeFile::Firmware::kMarlin;
  if (flavor.starts_with("Klipper")) return GcodeFile::Firmware::kKlipper;
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
    } else if (!commands_.empty()) {
      if (run_command(bead)) return true;
    } else if (!read_line()) {
      return false;
    } else if (text_.starts_with(';')) {
      if (observer_ != nullptr) observer_->on_comment(text_);
      if (read_tag()) return true;
    }
  }
  return false;
}

bool GcodeCommands::read_line() {
  before_ = line_start_ = position_;
  later_ = false;
  const bool read = file_.next(text_);
  position_.line += read || !file_.status() ? 1 : 0;
  position_.byte = file_.offset();
  constexpr std::size_t kMaxCommandBytes = 64 << 10;  // of commands: firmwares take some 256 bytes
  const bool comment = read && !text_.empty() && text_[std::min(text_.find_first_not_of(" \t"), text_.size() - 1)] == ';';
  if (read && !comment) commands_ = strip_comments(text_, stripped_);
  parentheses_ = commands_.data() == stripped_.data();
  if (!file_.status() || commands_.size() > kMaxCommandBytes)
    return fail("is no text of G-code; name a file that lamina extrude or a slicer wrote"), false;
  if (!read) return false;
  if (comment) text_.remove_prefix(text_.find(';'));
  if (file_.ended_by_cr()) differ(Difference::kCr);
  if (const std::size_t left = std::exchange(position_.left, 0); left > 0 && left <= commands_.size())
    commands_.remove_prefix(commands_.size() - left);
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

/// Up to the next command of the line, which stays in commands_. any  what is no word ends the command instead of the file
bool GcodeCommands::read_words(WordScanner& scanner, GcodeWords& words, bool any) {
  while (scanner.next()) {
    const char letter = scanner.letter();
    if ((letter == 'G' || letter == 'M') && scanner.has_number()) {
      commands_ = scanner.rest();
      later_ = true;
      scanner.differences |= bit_of(Difference::kSeveral);
      return true;
    }
    if (!scanner.has_number()) continue;  // as in G92 X
    const std::uint32_t bit = 1u << (letter - 'A');
    if (words.given & bit) scanner.differences |= bit_of(Difference::kTwice);
    words.given |= bit;
    words.value[letter - 'A'] = scanner.value();
  }
  if (!scanner.failed()) return true;
  if (any) return scanner.differences = 0, true;
  const std::string_view text = scanner.no_number() ? scanner.behind() : scanner.rest();
  if (scanner.no_number()) {
    fail(fmt::format("'{}' is not a number", one_line(text.substr(0, std::min<std::size_t>(text.find(' '), 20)))));
  } else {
    fail(fmt::format("'{}' is no word of a move", one_line(text.substr(0, 21))));
  }
  return false;
}

/// Marlin's G90 and G91 replace what M82 and M83 said (MarlinFirmware/Marlin, GcodeSuite::set_relative_mode()).
void GcodeCommands::set_relative(bool relative) {
  position_.relative = relative;
  if (position_.firmware == GcodeFile::Firmware::kMarlin) position_.relative_feed = relative;
}

/// T names the tool in Marlin, D the drive in RepRapFirmware; Klipper has one percentage.
void GcodeCommands::set_flow(const GcodeWords& words) {
  if (!words.has('S')) return differ(Difference::kFlow);
  const double percent = words['S'], tool = words.has('T') ? words['T'] : words.has('D') ? words['D'] : position_.tool;
  if (!(percent >= 0 && percent <= 10'000)) return fail(fmt::format("M221 S{:g}: a flow is 0 to 10000 %", percent));
  const auto set = static_cast<float>(percent);
  const std::size_t index = static_cast<std::size_t>(std::clamp<double>(tool, 0, GcodeFile::kTools - 1));
  if (index != position_.tool && set != position_.flow[position_.tool]) differ_by_tool();
  position_.flow[index] = set;
  if (position_.firmware == GcodeFile::Firmware::kKlipper) std::ranges::fill(position_.flow, set);
  if (percent != 100 && flows.count == 0) flow = percent;
  if (percent != 100) flows.add(position_.line);
}

/// Only files that do not name their firmware.
void GcodeCommands::differ_by_tool() {
  if (position_.firmware == GcodeFile::Firmware::kUnknown) differ(Difference::kFlowOfTool);
}

void GcodeCommands::change_tool(double number) {
  const double tool = std::clamp<double>(number, 0, GcodeFile::kTools - 1);
  if (tool != position_.tool) position_.retracted = 0;  // what another tool has drawn back is not fed by this one
  const std::uint8_t before = std::exchange(position_.tool, static_cast<std::uint8_t>(tool));
  if (position_.flow[before] != position_.flow[position_.tool]) differ_by_tool();
}

/// Of beads: P in Marlin and RepRapFirmware, S in Klipper and old files of Marlin. What no machine can do is ignored.
void GcodeCommands::set_acceleration(double mm_s2) {
  if (mm_s2 > 0 && mm_s2 <= 1e6) position_.acceleration = mm_s2;
}

/// Of E. G91 or M83 makes it relative in Klipper (klippy/extras/gcode_move.py, GCodeMove.cmd_G1) and in PrusaSlicer's view
/// of its own files (GCodeProcessor::process_G1); in RepRapFirmware M83 alone does.
bool GcodeCommands::feeds_relative() const {
  return position_.relative_feed || (position_.relative && position_.firmware != GcodeFile::Firmware::kMarlin &&
                                     position_.firmware != GcodeFile::Firmware::kRepRap);
}

void GcodeCommands::set_mode(char letter, double code, const GcodeWords& words) {
  if (letter == 'M') {
    if (code == 82 || code == 83) position_.m83 = position_.relative_feed = code == 83;
    if (code == 200) {  // Marlin: M200 D1.75 counts E in mm3, M200 D0 or S0 does not
      if (words.has('D')) position_.volumetric = words['D'] > 0;
      if (words.has('S')) position_.volumetric = words['S'] != 0;
    }
    if (code == 204) set_acceleration(words[words.has('P') ? 'P' : 'S']);
    if (code == 221) set_flow(words);
    return;
  }
  if (code == 17 || code == 18 || code == 19) position_.plane = static_cast<std::uint8_t>(code);
  if (code == 20) position_.unit = 25.4;
  if (code == 21) position_.unit = 1;
  if (code == 90 || code == 91) set_relative(code == 91);
  if (code == 90.1) fail("G90.1: firmwares of printers take centres of arcs from the start; export them so");
  if (code == 5) fail("splines (G5) are not drawn; export lines or arcs");
}

namespace {

/// M commands whose argument may be text without quotes in Marlin or RepRapFirmware, which therefore no other command follows
/// in a line.
bool takes_text(double code) {
  constexpr double kText[] = {16, 20,  23,  26,  28,  30,  32,  33,  36,  37,  38, 39,
                              98, 117, 118, 486, 550, 551, 552, 587, 588, 589, 928};
  return std::ranges::find(kText, code) != std::end(kText);
}

}  // namespace

/// What follows a command that changes nothing here: RepRapFirmware runs the next G or M of the line
/// (StringParser::FindParameters).
bool GcodeCommands::pass_over(WordScanner scanner, char letter, double code) {
  GcodeWords words;
  if (read_words(scanner, words, true) && !commands_.empty()) differ(Difference::kSeveral);
  if (observer_ != nullptr) observer_->on_command(letter, code, words);
  return false;
}

/// Takes the next command of the line. returns  whether it deposits a bead
bool GcodeCommands::run_command(std::optional<RawBead>& bead) {
  if (later_) {
    before_ = position_;
    before_.byte = line_start_.byte;
    before_.line = line_start_.line;
    before_.left = static_cast<std::uint32_t>(commands_.size());
  }
  deposited_ = false;
  constexpr std::string_view kLimit = "SET_VELOCITY_LIMIT", kName = " ACCEL=";  // Klipper
  if (commands_.starts_with(kLimit)) {
    const std::size_t at = commands_.find(kName);
    if (at != std::string_view::npos) set_acceleration(leading_number(commands_.substr(at + kName.size())));
    commands_ = {};
    return false;
  }
  const std::string_view command = commands_;
  const auto pass_text = [&] {
    if (observer_ != nullptr) observer_->on_text(command);
    return false;
  };
  WordScanner scanner(std::exchange(commands_, {}));
  bool found = scanner.next();
  if (found && scanner.letter() == 'N') found = scanner.next();  // behind a line's number
  if (!found) return pass_text();
  char letter = scanner.letter();
  double code = scanner.value();
  const bool repeats = letter == 'E' || letter == 'F' || (letter >= 'X' && letter <= 'Z');
  if (!scanner.has_number() || (!repeats && letter != 'G' && letter != 'M' && letter != 'T')) return pass_text();
  if (letter == 'T') {
    change_tool(code);
    return pass_over(scanner, letter, code);
  }
  if (letter == 'M' && code != 82 && code != 83 && code != 200 && code != 204 && code != 221)
    return !takes_text(code) && pass_over(scanner, letter, code);
  if (repeats) {
    if (position_.motion > 3) return false;
    const std::uint32_t before = scanner.differences | bit_of(Difference::kRepeat);
    scanner = WordScanner(scanner.rest());
    scanner.differences = before;
    letter = 'G';
    code = position_.motion;
  }
  const bool moves = letter == 'G' && (code == 0 || code == 1 || code == 2 || code == 3),
             sets = letter == 'G' ? code == 92 : code == 200 || code == 221;
  GcodeWords words;
  if (!read_words(scanner, words, repeats || (!moves && !sets))) return false;
  if (repeats && scanner.failed()) return differ(Difference::kText), false;
  if (parentheses_) differ(Difference::kParentheses);
  for (std::uint32_t left = scanner.differences; left != 0; left &= left - 1)
    differ(static_cast<Difference>(std::countr_zero(left)));
  if (moves) position_.motion = static_cast<std::uint8_t>(code);
  if (moves || (letter == 'G' && code == 92)) return move(code, words, bead);
  set_mode(letter, code, words);
  if (observer_ != nullptr) observer_->on_command(letter, code, words);
  return false;
}

bool GcodeCommands::within_reach(const RawBead& bead) {
  for (const double at : {bead.from[0], bead.from[1], bead.from[2], bead.to[0], bead.to[1], bead.to[2]}) {
    if (std::abs(at) <= kFarthestMm) continue;
    fail(fmt::format("a bead at {:g} mm; beds are at most {:g} mm wide", at, kFarthestMm));
    return false;
  }
  return true;
}

/// Moves whose E commands filament and that yet feed none, as where absolute and relative E were mistaken for each other.
void GcodeCommands::count_unfed(const GcodeWords& words, double fed) {
  ++moves_with_e;
  if (fed == 0) unfed.add(position_.line);
  if (position_.m83 && !position_.relative_feed && words['E'] > 0 && fed <= 0) unfed_after_g90.add(position_.line);
}

/// On the spot, or back.
void GcodeCommands::feed(double fed) {
  position_.primed += fed;
  position_.retracted = std::max(position_.retracted - fed, 0.0);
}

/// A bead without the part of the move that feeds again what was drawn back; false if that is all of it.
bool GcodeCommands::deposit(RawBead raw, std::optional<RawBead>& bead) {
  constexpr double kRounding = 1e-3;  // of a move: E has five decimals, and retractions are several moves
  const double again = std::min(raw.fed, position_.retracted), net = raw.fed - again;
  raw.joined = std::exchange(position_.deposits, false);
  if (again > 0) {
    if (!(net > kRounding * raw.fed)) return feed(raw.fed), false;
    position_.retracted = 0;
    const double part = again / raw.fed;
    for (std::size_t k = 0; k < 3 && part > kRounding; ++k) raw.from[k] += part * (raw.to[k] - raw.from[k]);
    raw.joined = raw.joined && part <= kRounding;
  }
  raw.fed = net;
  raw.primed = std::exchange(position_.primed, 0) + again;
  raw.first = !std::exchange(deposited_, true);
  raw.acceleration = position_.acceleration;
  if (!within_reach(raw)) return false;
  position_.deposits = true;
  bead = raw;
  return true;
}

bool GcodeCommands::move(double code, const GcodeWords& words, std::optional<RawBead>& bead) {
  constexpr char kAxes[] = {'X', 'Y', 'Z', 'E'};
  double to[4];
  for (std::size_t k = 0; k < 4; ++k) {
    const bool relative = code != 92 && (k == 3 ? feeds_relative() : position_.relative);
    to[k] = position_.at[k];
    if (words.has(kAxes[k])) to[k] = (relative ? position_.at[k] : 0) + words[kAxes[k]] * position_.unit;
  }
  double(&at)[4] = position_.at;
  if (code != 92) {
    // RepRapFirmware leaves retractions on the spot as they are (GCodes::LoadExtrusionAndFeedrateFromGCode).
    const bool spot = !words.has('X') && !words.has('Y') && !words.has('Z');
    const bool scaled = !spot || position_.firmware != GcodeFile::Firmware::kRepRap;
    const double fed = (to[3] - at[3]) * (scaled ? position_.flow[position_.tool] / 100.0 : 1);
    if (words.has('F')) position_.speed = std::max(words['F'] * position_.unit / 60, 0.0);
    if (words.has('E') && !spot) count_unfed(words, fed);
    const bool arc = code == 2 || code == 3;
    if (arc && !begin_arc(code == 2, words, to, fed)) return false;
    if (observer_ != nullptr && chord_ == 0) observer_->on_move({at, to, fed, words.has('F')});
    if (!arc && fed > 0 && (to[0] != at[0] || to[1] != at[1])) {
      deposit({{at[0], at[1], at[2]}, {to[0], to[1], to[2]}, fed, position_.volumetric, position_.speed, false, 0, true}, bead);
    } else if (chord_ == 0) {
      position_.deposits = position_.deposits && !arc && std::equal(std::begin(to), std::end(to), at);
      feed(fed);
    }
  }
  std::copy(std::begin(to), std::end(to), at);
  return bead.has_value() || (chord_ > 0 && next_chord(bead));
}

/// False if the printer does not move.
bool GcodeCommands::begin_arc(bool clockwise, const GcodeWords& words, const double (&to)[4], double fed) {
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
  RawBead piece{{from.x, from.y, z_of(chord_ - 1)},
                {to.x, to.y, z_of(chord_)},
                whole_.fed / static_cast<double>(arc_.chords()),
                whole_.volumetric,
                whole_.speed,
                false,
                0,
                true};
  // Also while what was retracted is fed again: beyond the bed an arc may have any number of chords.
  if (!within_reach(piece)) return false;
  if (observer_ != nullptr) observer_->on_move({piece.from, piece.to, piece.fed, false});
  chord_ = chord_ < arc_.chords() ? chord_ + 1 : 0;
  return (from.x != to.x || from.y != to.y) && deposit(piece, bead);
}

}  // namespace lamina::formats
