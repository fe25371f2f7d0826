#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

constexpr Word<raster::BeadEnds> kBeadEnds[] = {{"round", raster::BeadEnds::kRound}, {"square", raster::BeadEnds::kSquare}};

std::string read_blocked(Text text, Job& job) {
  std::vector<std::uint32_t> nozzles;
  for (const Text piece : text.empty() ? std::vector<Text>() : split(text, ",")) {
    std::int64_t nozzle = 0;
    if (auto wrong = read_whole(piece, 0, 65'534, nozzle); !wrong.empty()) return wrong;
    nozzles.push_back(static_cast<std::uint32_t>(nozzle));
  }
  job.machine.blocked = nozzles;
  return {};
}

std::string read_bleed(Text text, Job& job) {
  const auto pieces = split(text, ",x");
  if (pieces.size() > 2) return fmt::format("'{}' is not one or two numbers; write 40 or 40x60", text);
  std::array<double, 2> bleed{};
  for (std::size_t i = 0; i < 2; ++i) {
    if (auto wrong = read_number(pieces[i < pieces.size() ? i : 0], 0, 10'000, " um", bleed[i]); !wrong.empty()) return wrong;
  }
  job.dose.bleed_um = bleed;
  return {};
}

const JobKey kMachineKeys[] = {
    {"machine", "profile", "--machine", "NAME|FILE",
     "write the print program of this machine, and take bed and dpi from it; lamina machines lists them", true,
     [](Text t, Job& j) { return read_path(t, j.machine.profile); }, [](const Job& j) { return j.machine.profile; },
     Form::kString},
    {"machine", "scan_speed_mm_s", "--scan-speed", "MM/S", "of the head over the bed, instead of the machine's", true,
     [](Text t, Job& j) {
       double speed = 0;
       auto wrong = read_number(t, 1e-3, 1e6, " mm/s", speed);
       if (wrong.empty()) j.machine.scan_speed_mm_s = speed;
       return wrong;
     },
     [](const Job& j) { return j.machine.scan_speed_mm_s ? number_text(*j.machine.scan_speed_mm_s) : std::string(); },
     Form::kBare},
    {"machine", "blocked", "--blocked", "N,N,...", "nozzles that do not fire, from 0, instead of the machine's", true,
     read_blocked,
     [](const Job& j) { return j.machine.blocked ? fmt::format("{}", fmt::join(*j.machine.blocked, ",")) : std::string(); },
     Form::kList},
};

const JobKey kDoseKeys[] = {
    {"dose", "bleed_um", "--bleed", "UM|XxY", "leave out pixels nearer to the edge than binder spreads, along x and y", true,
     read_bleed, [](const Job& j) { return write_list(j.dose.bleed_um); }, Form::kList},
    {"dose", "shell_mm", "--shell", "MM", "depth below the edge of a layer that gets all its binder (with --core or --fill)",
     true, [](Text t, Job& j) { return read_number(t, 0, 1000, " mm", j.dose.shell_mm); },
     [](const Job& j) { return number_text(j.dose.shell_mm); }, Form::kBare},
    {"dose", "core", "--core", "SHARE", "of the pixels inside of the shell that is jetted, 0 to 1", true,
     [](Text t, Job& j) { return read_number(t, 0, 1, "", j.dose.core); },
     [](const Job& j) { return number_text(j.dose.core); }, Form::kBare},
    {"dose", "bead_ends", "--bead-ends", "round|square", "of the beads that fill a part, and of their thick and thin stretches",
     true, [](Text t, Job& j) { return read_word(kBeadEnds, t, j.dose.bead_ends); },
     // Jobs without beads are recorded as they were before there were any.
     [](const Job& j) {
       return j.dose.bead_ends == raster::BeadEnds::kRound ? std::string() : write_word(kBeadEnds, j.dose.bead_ends);
     },
     Form::kString},
};

}  // namespace

std::span<const JobKey> machine_keys() { return kMachineKeys; }
std::span<const JobKey> dose_keys() { return kDoseKeys; }

}  // namespace lamina::pipeline
