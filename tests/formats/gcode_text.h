// tests/formats/gcode_text.h: G-code files for the tests of their reader.
#pragma once

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>

#include "stages/formats/gcode/read_gcode.h"
#include "tests/commands/program.h"

namespace lamina::test {

inline constexpr double kPi = std::numbers::pi;

/// `text` as a file, read.
inline Result<formats::GcodeFile> gcode_file(const Directory& directory, const std::string& text,
                                             const formats::GcodeOptions& options = {}) {
  write_text(directory.path() / "part.gcode", text);
  return formats::GcodeFile::open(directory / "part.gcode", options);
}

/// mm of filament for a bead, written out: a rectangle with half circles at its sides (Slic3r's manual, flow math).
inline double filament_for(double length_mm, double width_mm, double height_mm, double diameter_mm = 1.75) {
  const double area = (width_mm - height_mm) * height_mm + std::numbers::pi * height_mm * height_mm / 4;
  return length_mm * area / (std::numbers::pi * diameter_mm * diameter_mm / 4);
}

/// A G-code file that a slicer wrote and that cannot be kept in this repository: in corpus/gcode beside the folder that
/// LAMINA_MODELS names; empty if it is not there.
inline std::string third_party_gcode(const std::string& name) {
  const char* models = std::getenv("LAMINA_MODELS");
  if (models == nullptr) return {};
  const auto path = std::filesystem::path(models) / ".." / "corpus" / "gcode" / name;
  return std::filesystem::exists(path) ? path.string() : std::string();
}

}  // namespace lamina::test
