#include "stages/program/binary_program.h"
#include "stages/program/writers.h"

namespace lamina::program::raw {
namespace {

constexpr std::size_t kSegmentHead = 8;

/// Four letters as the number that spells them.
constexpr std::uint32_t tag(const char (&letters)[5]) {
  std::uint32_t number = 0;
  for (int i = 3; i >= 0; --i) number = number << 8 | static_cast<unsigned char>(letters[i]);
  return number;
}

/// Of records of head maintenance.
constexpr std::array<std::uint32_t, 8> kRecords = {tag("GOTO"), tag("FILL"), tag("BASE"), tag("ROLL"),
                                                   tag("WIPE"), tag("SPIT"), tag("DRYS"), tag("LINE")};

class RawWriter final : public BinaryWriter {
 public:
  RawWriter(const Machine& machine, const HeadGrid& grid)
      : BinaryWriter(machine, grid, kRecords), words_((grid.nozzles + 127) / 128) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    const bool grey = grid_.drop_bits > 1;
    put_numbers(
        out, {tag("LRAW"), grey ? 2u : 1u, layers, grid_.nozzles, grid_.positions, grid_.lines, grid_.steps_per_pixel, words_});
    if (grey) put_numbers(out, {grid_.drop_bits});
  }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put_numbers(out, {tag("LAYR"), cycle.layer, cycle.layers, static_cast<std::uint32_t>(cycle.bottom_nm),
                      static_cast<std::uint32_t>(cycle.thickness_nm), vat_bits(cycle)});
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    const std::size_t vector_bytes = words_ * 16 * grid_.drop_bits;
    std::uint32_t segments = 0;
    for_each_segment(vectors, kSegmentHead, vector_bytes, [&](std::uint32_t, std::uint32_t) { ++segments; });
    const auto across = static_cast<std::uint64_t>(across_nm(machine_, grid_, sweep.first_line));
    put_numbers(out, {tag("SWTH"), sweep.number, sweep.of, sweep.backward ? 1u : 0u, static_cast<std::uint32_t>(across),
                      static_cast<std::uint32_t>(across >> 32), segments});
    put_segments<kSegmentHead>(
        vectors, sweep.backward, sweep.backward, vector_bytes, out,
        [&](std::byte* to, std::uint32_t begin, std::uint32_t count) {
          const std::uint32_t head[2] = {vectors.first_step + (sweep.backward ? begin + count - 1 : begin), count};
          std::memcpy(to, head, kSegmentHead);
        });
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override { put_numbers(out, {tag("LEND"), cycle.layer}); }
  void end(ProgramBytes& out) override { put_numbers(out, {tag("DONE")}); }

 private:
  std::uint32_t words_;  // of 128 bits a vector of one bit of the drops
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<RawWriter>(machine, grid);
}

}  // namespace lamina::program::raw
