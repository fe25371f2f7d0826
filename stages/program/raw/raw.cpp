#include "stages/program/raw/raw.h"

#include <algorithm>

#include "stages/program/binary_program.h"
#include "stages/program/maintenance/maintenance.h"

namespace lamina::program::raw {
namespace {

constexpr std::size_t kSegmentHead = 8;

void put_maintenance(MaintenanceRecord kind, std::span<const std::uint32_t> numbers, ProgramBytes& out) {
  constexpr char kTags[][5] = {"GOTO", "FILL", "BASE", "ROLL", "WIPE", "SPIT", "DRYS", "LINE"};
  put_tag(out, kTags[static_cast<std::size_t>(kind)]);
  put_little<std::uint32_t>(out, static_cast<std::uint32_t>(numbers.size()));
  for (const std::uint32_t number : numbers) put_little<std::uint32_t>(out, number);
}

class RawWriter final : public ProgramWriter {
 public:
  RawWriter(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), grid_(grid), words_((grid.nozzles + 127) / 128), maintenance_(machine, grid, put_maintenance) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    put_tag(out, "LRAW");
    const bool grey = grid_.drop_bits > 1;
    for (const std::uint32_t value :
         {grey ? 2u : 1u, layers, grid_.nozzles, grid_.positions, grid_.lines, grid_.steps_per_pixel, words_}) {
      put_little<std::uint32_t>(out, value);
    }
    if (grey) put_little<std::uint32_t>(out, grid_.drop_bits);
  }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put_tag(out, "LAYR");
    put_little<std::uint32_t>(out, cycle.layer);
    put_little<std::uint32_t>(out, cycle.layers);
    put_little<std::int32_t>(out, static_cast<std::int32_t>(cycle.bottom_nm));
    put_little<std::int32_t>(out, static_cast<std::int32_t>(cycle.thickness_nm));
    put_little<std::uint32_t>(out, vat_bits(cycle));
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    const std::size_t vector_bytes = words_ * 16 * grid_.drop_bits;
    std::uint32_t segments = 0;
    for_each_segment(vectors, kSegmentHead, vector_bytes, [&](std::uint32_t, std::uint32_t) { ++segments; });
    put_tag(out, "SWTH");
    put_little<std::uint32_t>(out, sweep.number);
    put_little<std::uint32_t>(out, sweep.of);
    put_little<std::uint32_t>(out, sweep.backward ? 1 : 0);
    put_little<std::int64_t>(out, across_nm(machine_, grid_, sweep.first_line));
    put_little<std::uint32_t>(out, segments);
    put_segments<kSegmentHead>(
        vectors, sweep.backward, sweep.backward, vector_bytes, out,
        [&](std::byte* to, std::uint32_t begin, std::uint32_t count) {
          const std::uint32_t head[2] = {vectors.first_step + (sweep.backward ? begin + count - 1 : begin), count};
          std::memcpy(to, head, kSegmentHead);
        });
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put_tag(out, "LEND");
    put_little<std::uint32_t>(out, cycle.layer);
  }
  void end(ProgramBytes& out) override { put_tag(out, "DONE"); }

  void maintenance_of_layer(const LayerCycle& cycle, ProgramBytes& out) override { maintenance_.begin_layer(cycle, out); }
  void maintenance_before(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    maintenance_.before_sweep(sweep, vectors, out);
  }
  void maintenance_after(ProgramBytes& out) override { maintenance_.dry(out); }

 private:
  const Machine& machine_;
  const HeadGrid& grid_;
  std::uint32_t words_;  // of 128 bits a vector of one bit of the drops
  MaintenanceRecords maintenance_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  static_assert(std::endian::native == std::endian::little);
  return std::make_unique<RawWriter>(machine, grid);
}

}  // namespace lamina::program::raw
