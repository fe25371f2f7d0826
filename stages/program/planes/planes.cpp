#include "stages/program/planes/planes.h"

#include <algorithm>

#include "stages/program/binary_program.h"
#include "stages/program/maintenance/maintenance.h"

namespace lamina::program::planes {
namespace {

constexpr std::uint32_t kLayer = 0x4C01, kPlane = 0x4C02, kEnd = 0x4C03, kStart = 0x4C04, kDone = 0x4C05, kGrey = 0x4C06;
constexpr std::size_t kPlaneHead = 36, kGreyHead = 40;

constexpr std::uint32_t kMaintenance = 0x4C10;  // and the number of the record

void put_maintenance(MaintenanceRecord kind, std::span<const std::uint32_t> numbers, ProgramBytes& out) {
  put_little<std::uint32_t>(out, kMaintenance + static_cast<std::uint32_t>(kind));
  put_little<std::uint32_t>(out, static_cast<std::uint32_t>(numbers.size()));
  for (const std::uint32_t number : numbers) put_little<std::uint32_t>(out, number);
}

class PlanesWriter final : public ProgramWriter {
 public:
  PlanesWriter(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), grid_(grid), words_((grid.nozzles + 31) / 32), maintenance_(machine, grid, put_maintenance) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    const bool grey = grid_.drop_bits > 1;
    for (const std::uint32_t value : {kStart, grey ? 8u : 7u, grey ? 2u : 1u, layers, grid_.nozzles, grid_.positions,
                                      grid_.lines, grid_.steps_per_pixel, words_}) {
      put_little<std::uint32_t>(out, value);
    }
    if (grey) put_little<std::uint32_t>(out, grid_.drop_bits);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    const std::uint32_t vats = vat_bits(cycle);
    for (const std::int64_t value : {std::int64_t{kLayer}, std::int64_t{vats == 1 ? 4 : 5}, std::int64_t{cycle.layer},
                                     std::int64_t{cycle.layers}, cycle.bottom_nm, cycle.thickness_nm}) {
      put_little<std::uint32_t>(out, static_cast<std::uint32_t>(value));
    }
    if (vats != 1) put_little<std::uint32_t>(out, vats);
  }

  // Planes of one sweep, in the order of the movement; inside of a plane steps increase.
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    const auto across = static_cast<std::uint32_t>(across_nm(machine_, grid_, sweep.first_line));
    if (const std::uint32_t bits = grid_.drop_bits; bits > 1) {
      put_segments<kGreyHead>(
          vectors, sweep.backward, false, words_ * 4, out,
          [&](std::byte* to, std::uint32_t begin, std::uint32_t count) {
            const std::uint32_t head[10] = {
                kGrey,  8 + count * words_ * bits,  sweep.number, sweep.of, sweep.backward ? 1u : 0u,
                across, vectors.first_step + begin, count,        words_,   bits};
            std::memcpy(to, head, kGreyHead);
          },
          bits);
      return;
    }
    put_segments<kPlaneHead>(
        vectors, sweep.backward, false, words_ * 4, out, [&](std::byte* to, std::uint32_t begin, std::uint32_t count) {
          const std::uint32_t head[9] = {kPlane, 7 + count * words_,         sweep.number, sweep.of, sweep.backward ? 1u : 0u,
                                         across, vectors.first_step + begin, count,        words_};
          std::memcpy(to, head, kPlaneHead);
        });
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    for (const std::uint32_t value : {kEnd, 1u, cycle.layer}) put_little<std::uint32_t>(out, value);
  }
  void end(ProgramBytes& out) override {
    for (const std::uint32_t value : {kDone, 0u}) put_little<std::uint32_t>(out, value);
  }

  void maintenance_of_layer(const LayerCycle& cycle, ProgramBytes& out) override { maintenance_.begin_layer(cycle, out); }
  void maintenance_before(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    maintenance_.before_sweep(sweep, vectors, out);
  }
  void maintenance_after(ProgramBytes& out) override { maintenance_.dry(out); }

 private:
  const Machine& machine_;
  const HeadGrid& grid_;
  std::uint32_t words_;  // of 32 bits a vector
  MaintenanceRecords maintenance_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  static_assert(std::endian::native == std::endian::little);
  return std::make_unique<PlanesWriter>(machine, grid);
}

}  // namespace lamina::program::planes
