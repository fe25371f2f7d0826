#include "pipeline/machine/new_profile.h"

#include <fmt/format.h>

#include "pipeline/job/errors.h"
#include "pipeline/machine/profiles.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

struct ProfileQuestion {
  std::string_view key, text, usual;
};

constexpr ProfileQuestion kFirmwareQuestion = {"code.flavor", "firmware: Marlin, RepRap (RepRapFirmware), Repetier or Klipper",
                                               "Marlin"};
constexpr ProfileQuestion kQuestions[] = {
    {"machine.name", "name of the printer", "My printer"},
    {"bed.size_mm", "width and depth of the bed in mm", "220x220"},
    {"bed.build_height_mm", "build height in mm", "250"},
    {"bed.corner_mm", "x and y of the bed's front left corner in mm", "0,0"},
    {"material.nozzle_mm", "nozzle diameter in mm", "0.4"},
    {"material.filament_mm", "filament diameter in mm", "1.75"},
    {"machine.max_nozzle_degc", "max nozzle temperature in degrees Celsius; 0: unknown", "0"},
    {"machine.max_bed_degc", "max bed temperature in degrees Celsius; 0: unknown", "0"},
    {"material.first_nozzle_degc", "nozzle temperature of the first layer", "210"},
    {"material.nozzle_degc", "nozzle temperature of the other layers", "205"},
    {"material.first_bed_degc", "bed temperature of the first layer", "60"},
    {"material.bed_degc", "bed temperature of the other layers", "60"}};

constexpr int kMaxWrong = 100;

Status query(const ProfileQuestion& question, const AnswerSource& answer, ExtruderProfile& profile) {
  std::string reason;
  for (int i = 0; i < kMaxWrong; ++i) {
    const auto line = answer(fmt::format("{}{} [{}]: ", reason, question.text, question.usual));
    if (!line) return usage("--new: the input ends before the answer to '{}'", question.text);
    const std::string_view given = trimmed(line->ends_with('\r') ? std::string_view(*line).substr(0, line->size() - 1) : *line);
    const std::string wrong = set_extruder_key(question.key, given.empty() ? question.usual : given, profile);
    if (wrong.empty()) return {};
    reason = one_line(wrong) + "\n";
  }
  return usage("--new: {} wrong answers to '{}'", kMaxWrong, question.text);
}

}  // namespace

Result<std::string> new_profile(const AnswerSource& answer) {
  ExtruderProfile firmware;
  if (Status status = query(kFirmwareQuestion, answer, firmware); !status) return status.error();
  const std::string flavor = firmware.machine.code.flavor;
  auto profile = find_extruder(flavor == "Klipper" ? "klipper" : flavor == "RepRap" ? "reprapfirmware" : "marlin");
  if (!profile) return profile.error();
  Extruder& machine = profile->machine;
  machine.code.flavor = flavor;
  for (const ProfileQuestion& question : kQuestions) {
    if (Status status = query(question, answer, *profile); !status) return status.error();
  }
  machine.description = fmt::format("{}; {:g} x {:g} x {:g} mm; {:g} mm nozzle", flavor, machine.bed.size_mm[0],
                                    machine.bed.size_mm[1], machine.bed.build_height_mm, machine.material.nozzle_mm);
  return fmt::format("{}\n\n{}", kNewProfileMark, extruder_text(*profile));
}

}  // namespace lamina::pipeline
