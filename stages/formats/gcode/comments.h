// stages/formats/gcode/comments.h: what the comments of slicers tell of the filament and the nozzle of a G-code file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace lamina::read {

/// Facts of a whole file, gathered line by line; a later comment of the same kind does not replace an earlier one.
///
///     ; filament_diameter = 1.75,1.75      Slic3r, PrusaSlicer, Orca; with a colon BambuStudio
///     ;   filamentDiameters,1.75|1.75      Simplify3D
///     ; fiber_dia_mm = 1.75                KISSlicer
///     ;Filament Diameter #1: 1.75          ideaMaker
///     ;CURA_PROFILE_STRING:eNrt...         Cura up to 15.04: settings, deflated, base64
///     ;SETTING_3 {"...                     Cura since then: what of its profile was changed
///     ;Filament used: 1.3m 9.1g            Cura up to 15.04: what a metre weighs tells 1.75 mm from 2.85 mm
///     ;FLAVOR:Griffin                      CuraEngine: printers for 2.85 mm
///     ;FLAVOR:UltiGCode                    CuraEngine: E counts mm3; so does "; use_volumetric_e = 1" of PrusaSlicer
///     ; machine: Anet A8                   lamina
///     ; filament_density = 1.24,1.24       PrusaSlicer, Orca; with a colon BambuStudio
///     ; filament used [cm3] = 1.23         lamina, PrusaSlicer: density by what [g] of it weigh
struct SlicerFacts {
  double filament_mm = 0;    // diameter; 0 if untold
  double nozzle_mm = 0;      // 0 if untold
  double density_g_cm3 = 0;  // 0 if untold
  bool volumetric = false;
  std::string machine;  // a name, at most 100 characters; empty if untold

  /// Takes a line that begins with a semicolon.
  void read(std::string_view comment);

 private:
  /// How sure a way to know the diameter is.
  enum class Source : std::uint8_t { kNone, kFlavor, kWeight, kProfile, kSetting };
  Source source_ = Source::kNone;
  double used_cm3_ = 0;
  bool density_set_ = false;
  void tell_density(double g_cm3);
  void tell_filament(double diameter_mm, Source source);
  void read_flavor(std::string_view flavor);
  void read_weight(std::string_view used);
  void read_setting(std::string_view comment);
};

/// The value of a setting in a CURA_PROFILE_STRING; 0 if it is not there.
/// cost  64 KiB at most are inflated
double cura_profile_number(std::string_view base64, std::string_view setting);

}  // namespace lamina::read
