#include "stages/formats/gcode/replay/heaters.h"

#include <algorithm>

namespace lamina::formats::gcode {

void Heaters::command(char letter, double code, const GcodeWords& words, std::uint8_t tool) {
  const bool target = words.has('S') || words.has('R');
  const double degc = words.has('S') ? words['S'] : words['R'];
  const bool sets = (letter == 'M' && (code == 104 || code == 109 || code == 568)) || (letter == 'G' && code == 10);
  if (sets && target) {
    const char name = letter == 'M' && code != 568 ? 'T' : 'P';
    const double named = words.has(name) ? words[name] : tool;
    const auto index = static_cast<std::size_t>(std::clamp<double>(named, 0, GcodeFile::kTools - 1));
    nozzle_[index] = degc;
    named_ |= 1u << index;
    commanded_ = true;
  }
  if (letter != 'M') return;
  if (code == 109 || code == 116) waited_ = true;
  if ((code == 140 || code == 190) && target) bed_ = degc;
  if (code != 302) return;
  // Marlin: M302 P1 permits cold extrusion, S states the minimum. RepRapFirmware: P1 permits it.
  if (words.has('S')) min_ = degc;
  if (words.has('P')) min_ = words['P'] != 0 ? 0 : -1;
}

double Heaters::nozzle_degc(std::uint8_t tool) const {
  const std::size_t index = std::min<std::size_t>(tool, GcodeFile::kTools - 1);
  return named_ >> index & 1 ? nozzle_[index] : *std::ranges::max_element(nozzle_);
}

double Heaters::min_degc(GcodeFile::Firmware firmware) const {
  if (min_ >= 0) return min_;
  return firmware == GcodeFile::Firmware::kRepRap ? kRepRapMinDegc : kMinDegc;
}

}  // namespace lamina::formats::gcode
