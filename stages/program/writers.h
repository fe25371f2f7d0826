// stages/program/writers.h: writers of print programs, one per dialect; the README of each folder has the format.
#pragma once

#include "stages/program/dialect.h"

namespace lamina::program {

namespace nuferbj {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
}  // namespace nuferbj

namespace raw {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
}  // namespace raw

namespace planes {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
}  // namespace planes

namespace hp45 {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
/// Whether the controller can jet the machine's images.
/// errors  kUsage: rows of its own, lags in ticks, more steps than its buffer holds, an encoder too coarse for its pixels,
///         nozzles without a channel of their own, a scan speed that it cannot measure
Status check(const Machine& machine, const HeadGrid& grid);
}  // namespace hp45

namespace oasis {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
/// errors  kUsage: those of hp45, and two vats
Status check(const Machine& machine, const HeadGrid& grid);
}  // namespace oasis

namespace brundlefab {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
/// What the firmware can move and fire. errors  kUsage: another dot than that of the ink bar, other axes, a bed outside of
/// what the bar, the carriage and the bins reach, a second feed bin, more than a dot a millisecond
Status check(const Machine& machine, const HeadGrid& grid);
}  // namespace brundlefab

namespace m578 {
std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);
/// errors  kUsage: a version of the firmware that has no M578
Status check(const Machine& machine, const HeadGrid& grid);
/// MaintenanceRules: shots of one nozzle after the other, and a sweep that stops at each step and fires all.
double shot_s(const Machine& machine);
double longest_sweep_s(const Machine& machine, const HeadGrid& grid);
}  // namespace m578

}  // namespace lamina::program
