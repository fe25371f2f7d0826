// Print programs, replayed: each dialect by a shipped machine with a small bed.
#include <map>

#include "pipeline/machine/profiles.h"
#include "stages/program/compile.h"
#include "stages/program/dialect.h"
#include "stages/replay/machine.h"
#include "tests/fuzz/laws.h"
#include "tests/program/machines.h"

namespace lamina::fuzz {
namespace {

/// A machine of the dialect, and the image that its programs are to print.
struct Bench {
  pipeline::ResolvedMachine resolved;
  Runs image;
  std::optional<replay::VirtualMachine> machine;
};

const Layer kLayer{7, 700'000, 100'000, LayerReason::kUniform};

Bench make_bench(std::string_view dialect) {
  for (const auto& shipped : pipeline::shipped_machines()) {
    Machine machine = *pipeline::read_machine(shipped.text, std::string(shipped.name));
    if (machine.dialect != dialect) continue;
    // A bed of so many of its own pixels.
    const PixelGrid grid = pipeline::resolve_profile(machine)->grid.image;
    machine.bed.size_mm = {60 / grid.x.pixels_per_nm() / 1e6, 50 / grid.y.pixels_per_nm() / 1e6};
    if (!program::find_dialect(dialect)->has_motion) {  // records of care are bytes too
      machine.maintenance.spit_layers = machine.maintenance.wipe_layers = 7;
      machine.maintenance.spit_mm = {{-200, -200}};
      machine.maintenance.wipe_mm = {{-200, -300, -200, -250}};
      machine.maintenance.wipe_lines = {"M42 P4 S1"};
      machine.powder.dry_s = 1;
      machine.powder.roller_rpm = 99;
    }
    Bench bench{*pipeline::resolve_profile(machine), {}, {}};
    const PixelGrid& small = bench.resolved.grid.image;
    program::testing::Image pixels(small.rows(), std::vector<int>(small.columns(), 0));
    for (std::uint32_t r = 10; r < 20; ++r) {
      for (std::uint32_t c = 5; c < 25; c += 1 + r % 3) pixels[r][c] = 1;
    }
    bench.image = program::testing::runs_of(pixels);
    bench.machine.emplace(*replay::VirtualMachine::build(bench.resolved.machine, small.columns(), small.rows()));
    return bench;
  }
  throw std::logic_error("no shipped machine speaks this dialect");
}

const Bench& bench_of(std::string_view dialect) {
  static std::map<std::string_view, Bench> all;
  const auto found = all.find(dialect);
  return found != all.end() ? found->second : all.emplace(dialect, make_bench(dialect)).first->second;
}

bool replay_program(std::string_view dialect, std::string_view text) {
  const Bench& bench = bench_of(dialect);
  std::uint64_t drops = 0;
  const auto run = bench.machine->run(text, kLayer.index, [&](const replay::VirtualMachine::Drop& drop) {
    law(drop.column < bench.image.columns && drop.row < bench.image.view().rows(), "a drop outside of the image");
    law(drop.nozzle < bench.resolved.machine.head.nozzles, "a drop of no nozzle");
    ++drops;
  });
  if (!run) check_error(run.error());
  if (run) law(run->drops == drops, "drops are counted wrong");
  const auto printed = bench.machine->replay(text, kLayer, bench.image, 0, 0);
  if (!printed) return check_error(printed.error()), false;
  law(printed->drops == set_pixels(bench.image), "the image is printed with another number of drops");
  return true;
}

std::vector<std::string> program_seeds(std::string_view dialect) {
  const Bench& bench = bench_of(dialect);
  const auto writer = program::find_dialect(dialect)->make_writer(bench.resolved.machine, bench.resolved.grid);
  LayerCycle cycle;
  cycle.layer = kLayer.index;
  cycle.layers = 9;
  cycle.bottom_nm = kLayer.bottom;
  cycle.thickness_nm = kLayer.thickness;
  program::ProgramBytes bytes;
  writer->begin_layer(cycle, bytes);
  writer->maintenance_of_layer(cycle, bytes);
  program::CompileScratch scratch;
  const auto count = program::compile(bench.resolved.grid, bench.image, scratch,
                                      [&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
                                        writer->maintenance_before(sweep, vectors, bytes);
                                        writer->sweep(sweep, vectors, bytes);
                                        return {};
                                      });
  if (!count) throw std::logic_error(count.error().message);
  writer->maintenance_after(bytes);
  writer->end_layer(cycle, bytes);
  return {std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size())};
}

template <std::size_t N>
struct Name {
  char text[N];
  constexpr Name(const char (&from)[N]) { std::copy(from, from + N, text); }
};

template <Name kDialect>
Target target(std::string_view name) {
  return {name,
          [](std::string_view text) { return replay_program(kDialect.text, text); },
          [] { return program_seeds(kDialect.text); },
          "stages/replay stages/program/head_grid",
          "",
          "gcode.dict",
          name == "program_planes" ? std::size_t{32768} : std::size_t{4096}};
}

const Registered kNuferbj(target<"nuferbj">("program_nuferbj"));
const Registered kRaw(target<"raw">("program_raw"));
const Registered kPlanes(target<"planes">("program_planes"));
const Registered kHp45(target<"hp45">("program_hp45"));
const Registered kOasis(target<"oasis">("program_oasis"));
const Registered kBrundlefab(target<"brundlefab">("program_brundlefab"));
const Registered kM578(target<"m578">("program_m578"));

}  // namespace
}  // namespace lamina::fuzz
