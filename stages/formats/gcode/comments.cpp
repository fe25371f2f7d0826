#include "stages/formats/gcode/comments.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <memory>
#include <string>

namespace lamina::read {
namespace {

constexpr std::size_t kMostProfile = 64 << 10;  // bytes of settings; Cura's are some 5 kB

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

/// What a zlib stream begins with, kMostProfile bytes at most; empty if it is none.
std::string inflated(std::string& bytes) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return {};
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::string text(kMostProfile, '\0');
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

void SlicerFacts::tell_filament(double diameter_mm, Source source) {
  if (!(diameter_mm > 0.1 && diameter_mm < 20) || source <= source_) return;
  filament_mm = diameter_mm;
  source_ = source;
}

void SlicerFacts::tell_density(double g_cm3) {
  if (density_g_cm3 == 0 && g_cm3 > 0.1 && g_cm3 < 25) density_g_cm3 = g_cm3;
}

void SlicerFacts::read_flavor(std::string_view flavor) {
  // Cura: gcodeExport.cpp, GCodeExport::setFlavor(): these two count E in mm3.
  if (flavor.starts_with("UltiGCode") || flavor.starts_with("Marlin(Volumetric)")) volumetric = true;
  if (flavor.starts_with("Griffin")) tell_filament(2.85, Source::kFlavor);
}

void SlicerFacts::read_weight(std::string_view used) {
  const std::size_t metre = used.find("m "), gram = used.find('g');
  if (metre == std::string_view::npos || gram == std::string_view::npos || gram < metre) return;
  const double metres = leading_number(used), grams = leading_number(used.substr(metre + 2));
  if (!(metres > 0 && grams > 0)) return;
  // Plastics for filament weigh 0.9 to 1.4 g/cm3: 2.2 to 3.4 g a metre of 1.75 mm, 5.7 to 8.9 g of 2.85 mm.
  const double weight = grams / metres;
  if (weight > 2 && weight < 4) tell_filament(1.75, Source::kWeight);
  if (weight > 5 && weight < 10) tell_filament(2.85, Source::kWeight);
}

void SlicerFacts::read_setting(std::string_view comment) {
  const SettingLine line(comment);
  const std::string_view name = line.name();
  if (name == "filamentdiameter" || name == "filamentdiameters" || name == "fiberdiamm" || name == "materialdiameter") {
    tell_filament(leading_number(line.value), Source::kSetting);
  }
  if (name == "nozzlediameter" || name == "extruderdiameter" || name == "extrudertrainnozzlediameter") {
    const double diameter = leading_number(line.value);
    if (nozzle_mm == 0 && diameter > 0.05 && diameter < 10) nozzle_mm = diameter;
  }
  if (name == "filamentdensity" && !density_set_) {
    density_g_cm3 = 0;  // what is set goes before what was weighed
    tell_density(leading_number(line.value));
    density_set_ = density_g_cm3 > 0;
  }
  if (name == "filamentusedcm") used_cm3_ = leading_number(line.value);
  if (name == "filamentusedg" && used_cm3_ >= 0.2)  // told to 0.01
    tell_density(leading_number(line.value) / used_cm3_);
  if (name == "usevolumetrice" && leading_number(line.value) == 1) volumetric = true;
}

void SlicerFacts::read(std::string_view comment) {
  constexpr std::string_view kProfile = ";CURA_PROFILE_STRING:", kFlavor = ";FLAVOR:", kUsed = ";Filament used:";
  constexpr std::string_view kMachine = "; machine: ";
  constexpr std::string_view kCuraSettings = ";SETTING_3 ", kMaterial = "material_diameter = ";
  if (comment.starts_with(kProfile)) {
    if (source_ < Source::kProfile) {
      const std::string_view profile = comment.substr(kProfile.size());
      tell_filament(cura_profile_number(profile, "filament_diameter"), Source::kProfile);
    }
  } else if (comment.starts_with(kFlavor)) {
    read_flavor(comment.substr(kFlavor.size()));
  } else if (comment.starts_with(kUsed)) {
    read_weight(comment.substr(kUsed.size()));
  } else if (comment.starts_with(kMachine)) {
    if (machine.empty()) machine = comment.substr(kMachine.size(), 100);
  } else if (comment.starts_with(kCuraSettings)) {
    const std::size_t at = comment.find(kMaterial);
    if (at != std::string_view::npos) tell_filament(leading_number(comment.substr(at + kMaterial.size())), Source::kProfile);
  } else {
    for (const std::string_view sign : {"iameter", "IAMETER", "fiber_dia", "volumetric_e", "_density", "ment used ["}) {
      if (comment.find(sign) != std::string_view::npos) return read_setting(comment);
    }
  }
}

}  // namespace lamina::read
