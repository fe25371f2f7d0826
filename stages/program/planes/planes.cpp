#include "stages/program/binary_program.h"
#include "stages/program/writers.h"

namespace lamina::program::planes {
namespace {

constexpr std::uint32_t kLayer = 0x4C01, kPlane = 0x4C02, kEnd = 0x4C03, kStart = 0x4C04, kDone = 0x4C05, kGrey = 0x4C06;
constexpr std::size_t kPlaneHead = 36, kGreyHead = 40;

/// Of records of head maintenance.
constexpr std::array<std::uint32_t, 8> kRecords = {0x4C10, 0x4C11, 0x4C12, 0x4C13, 0x4C14, 0x4C15, 0x4C16, 0x4C17};

class PlanesWriter final : public BinaryWriter {
 public:
  PlanesWriter(const Machine& machine, const HeadGrid& grid)
      : BinaryWriter(machine, grid, kRecords), words_((grid.nozzles + 31) / 32) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    const bool grey = grid_.drop_bits > 1;
    put_numbers(out, {kStart, grey ? 8u : 7u, grey ? 2u : 1u, layers, grid_.nozzles, grid_.positions, grid_.lines,
                      grid_.steps_per_pixel, words_});
    if (grey) put_numbers(out, {grid_.drop_bits});
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    const std::uint32_t vats = vat_bits(cycle);
    put_numbers(out, {kLayer, vats == 1 ? 4u : 5u, cycle.layer, cycle.layers, static_cast<std::uint32_t>(cycle.bottom_nm),
                      static_cast<std::uint32_t>(cycle.thickness_nm)});
    if (vats != 1) put_numbers(out, {vats});
  }

  // Planes of one sweep, in the order of the movement; inside of a plane steps increase.
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    if (const std::uint32_t bits = grid_.drop_bits; bits > 1) {
      put_segments<kGreyHead>(
          vectors, sweep.backward, false, words_ * 4, out,
          [&](std::byte* to, std::uint32_t begin, std::uint32_t count) {
            const std::uint32_t head[10] = {
                kGrey,         8 + count * words_ * bits,  sweep.number, sweep.of, sweep.backward ? 1u : 0u,
                across(sweep), vectors.first_step + begin, count,        words_,   bits};
            std::memcpy(to, head, kGreyHead);
          },
          bits);
      return;
    }
    put_segments<kPlaneHead>(vectors, sweep.backward, false, words_ * 4, out, PlaneHead{sweep, vectors, across(sweep), words_});
  }
  Status stream_sweep(const Sweep& of, const SweepVectors& vectors, ProgramBytes& out, const Take& take) override {
    if (grid_.drop_bits == 1 && vectors.words * 2 == words_)
      return stream_segments<kPlaneHead>(vectors, of.backward, out, take, PlaneHead{of, vectors, across(of), words_});
    return ProgramWriter::stream_sweep(of, vectors, out, take);
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override { put_numbers(out, {kEnd, 1, cycle.layer}); }
  void end(ProgramBytes& out) override { put_numbers(out, {kDone, 0}); }

 private:
  /// Writes the head of a segment.
  struct PlaneHead {
    const Sweep& sweep;
    const SweepVectors& vectors;
    std::uint32_t across, words;
    void operator()(std::byte* to, std::uint32_t begin, std::uint32_t count) const {
      const std::uint32_t head[9] = {kPlane, 7 + count * words,          sweep.number, sweep.of, sweep.backward ? 1u : 0u,
                                     across, vectors.first_step + begin, count,        words};
      std::memcpy(to, head, kPlaneHead);
    }
  };
  std::uint32_t across(const Sweep& sweep) const {
    return static_cast<std::uint32_t>(across_nm(machine_, grid_, sweep.first_line));
  }

  std::uint32_t words_;  // of 32 bits a vector
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<PlanesWriter>(machine, grid);
}

}  // namespace lamina::program::planes
