// stages/program/dialect.h: how the program of a layer is spelt for a machine; one folder a dialect.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"

namespace lamina::program {

using ProgramBytes = Buffer<std::byte>;

/// Spells programs; each call appends to `out`, which the caller writes away as it likes. A layer's text depends on that
/// layer alone, so that layers can be written in any order. The concatenation of start, layers and end is the program.
class ProgramWriter {
 public:
  virtual ~ProgramWriter() = default;

  virtual void start(std::uint32_t layers, ProgramBytes& out) = 0;
  /// Everything before the head moves: build vat, feed vats, roller.
  virtual void begin_layer(const LayerCycle& cycle, ProgramBytes& out) = 0;
  /// Moves the head along one sweep; steps that fire nothing take no room.
  virtual void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) = 0;
  /// The same without copies of long vectors: take(bytes) gets those that follow the bytes in `out`. errors  of `take`
  using Take = std::function<Status(std::span<const std::byte>)>;
  virtual Status stream_sweep(const Sweep& of, const SweepVectors& vectors, ProgramBytes& out, const Take&) {
    sweep(of, vectors, out);
    return {};
  }
  virtual void end_layer(const LayerCycle& cycle, ProgramBytes& out) = 0;
  virtual void end(ProgramBytes& out) = 0;

  /// Maintenance in dialects of vectors alone, as records of their own; all others spell it within the lines above.
  /// Behind begin_layer(), before each sweep(), before end_layer().
  virtual void maintenance_of_layer(const LayerCycle&, ProgramBytes&) {}
  virtual void maintenance_before(const Sweep&, const SweepVectors&, ProgramBytes&) {}
  virtual void maintenance_after(ProgramBytes&) {}
};

/// What a dialect can express in addition to the drops and the powder of a layer, a bit each.
enum Saying : std::uint32_t {
  kSaysBase = 1,      // layers of powder below the first one
  kSaysRefill = 2,    // a pause for a vat to be filled
  kSaysDry = 4,       // a pause behind the sweeps
  kSaysRoller = 8,    // the speed of a roller that turns
  kSaysShots = 16,    // firing off the bed at the begin of a layer
  kSaysWipes = 32,    // the same for wiping
  kSaysSeconds = 64,  // what it says of both between sweeps as well, by the clock
  kSaysOwn = 128,     // lines of the machine's own, which its profile has
  kSaysCap = 256,     // where the head waits in pauses
  kSaysMaintenance = kSaysShots | kSaysWipes,
  kSaysAll = 511,
  kSaysDrops = 512  // several drops of a pixel in one sweep
};

/// Care where a head does not go to it as to any place, at the speed of travels, and fire at its highest frequency.
struct MaintenanceRules {
  double (*shot_s)(const Machine&) = nullptr;
  double (*longest_sweep_s)(const Machine&, const HeadGrid&) = nullptr;  // without the way to it
  bool own_positions = false;  // the dialect's check() holds places and limits in seconds itself
};

/// One row of the registry.
struct Dialect {
  std::string_view id;         // as in machine.dialect
  std::string_view extension;  // with the dot
  std::string_view description;
  std::uint32_t max_nozzles;
  std::uint32_t bit_order;  // HeadGrid::bit_order that its vectors have
  bool has_motion;          // the text moves axes and vats; else it is the data of the head alone
  std::uint32_t says;       // bits of Saying
  /// A writer for one thread. machine and grid have to live as long as it does.
  std::unique_ptr<ProgramWriter> (*make_writer)(const Machine& machine, const HeadGrid& grid);
  /// What it cannot express, apart from the number of nozzles. errors  kUsage
  Status (*check)(const Machine& machine, const HeadGrid& grid) = nullptr;
  MaintenanceRules maintenance = {};
  /// Files with the data of the head alone are for a host, which expands them.
  bool compressed() const { return !has_motion; }
};

std::span<const Dialect> dialects();

/// The dialect with this id, or nullptr.
const Dialect* find_dialect(std::string_view id);

/// Whether a dialect can speak to a machine. errors  kUsage: too many nozzles, ...
Status check_dialect(const Dialect& dialect, const Machine& machine, const HeadGrid& grid);

}  // namespace lamina::program
