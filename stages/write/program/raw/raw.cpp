#include "stages/write/program/raw/raw.h"

#include <algorithm>

#include "stages/write/program/binary_program.h"

namespace lamina::write::raw {
namespace {

constexpr std::size_t kSegmentHead = 8;

class Writer final : public ProgramWriter {
 public:
  Writer(const Machine& machine, const HeadGrid& grid) : machine_(machine), grid_(grid), words_((grid.nozzles + 127) / 128) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    put_tag(out, "LRAW");
    for (const std::uint32_t value : {1u, layers, grid_.nozzles, grid_.places, grid_.lines, grid_.steps_per_pixel, words_}) {
      put_little<std::uint32_t>(out, value);
    }
  }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put_tag(out, "LAYR");
    put_little<std::uint32_t>(out, cycle.layer);
    put_little<std::uint32_t>(out, cycle.layers);
    put_little<std::int32_t>(out, static_cast<std::int32_t>(cycle.bottom_nm));
    put_little<std::int32_t>(out, static_cast<std::int32_t>(cycle.thickness_nm));
    std::uint32_t vats = 0;
    for (const std::uint32_t vat : cycle.feeds) vats |= 1u << vat;
    put_little<std::uint32_t>(out, vats);
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    const std::size_t vector_bytes = words_ * 16;
    std::uint32_t segments = 0;
    for_each_segment(vectors, kSegmentHead, vector_bytes, [&](std::uint32_t, std::uint32_t) { ++segments; });
    put_tag(out, "SWTH");
    put_little<std::uint32_t>(out, sweep.number);
    put_little<std::uint32_t>(out, sweep.of);
    put_little<std::uint32_t>(out, sweep.backward ? 1 : 0);
    put_little<std::int64_t>(out, across_nm(machine_, grid_, sweep.first_line));
    put_little<std::uint32_t>(out, segments);
    // A sweep back is written in the order of the movement: segments and the steps in them from the last to the first.
    const auto write = [&](std::uint32_t begin, std::uint32_t count, std::size_t at) {
      std::byte* to = out.data() + at;
      const auto number = [&](std::uint32_t value) {
        for (int byte = 0; byte < 4; ++byte) *to++ = static_cast<std::byte>(value >> (8 * byte) & 255);
      };
      number(vectors.first_step + (sweep.backward ? begin + count - 1 : begin));
      number(count);
      for (std::uint32_t k = 0; k < count; ++k) {
        const std::uint32_t place = sweep.backward ? begin + count - 1 - k : begin + k;
        const std::uint64_t* words = vectors.bits.data() + std::size_t{place} * vectors.words;
        for (std::uint32_t w = 0; w < words_; ++w, to += 16) {
          const std::uint64_t high = 2 * w + 1 < vectors.words ? words[2 * w + 1] : 0;
          const std::uint64_t turned[2] = {__builtin_bswap64(high), __builtin_bswap64(words[2 * w])};
          std::memcpy(to, turned, 16);
        }
      }
    };
    std::size_t at = out.size();
    for_each_segment(vectors, kSegmentHead, vector_bytes,
                     [&](std::uint32_t, std::uint32_t count) { at += kSegmentHead + count * vector_bytes; });
    std::size_t next = sweep.backward ? at : out.size();
    out.resize(at);
    for_each_segment(vectors, kSegmentHead, vector_bytes, [&](std::uint32_t begin, std::uint32_t count) {
      const std::size_t bytes = kSegmentHead + count * vector_bytes;
      if (sweep.backward) next -= bytes;
      write(begin, count, next);
      if (!sweep.backward) next += bytes;
    });
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put_tag(out, "LEND");
    put_little<std::uint32_t>(out, cycle.layer);
  }
  void end(ProgramBytes& out) override { put_tag(out, "DONE"); }

 private:
  const Machine& machine_;
  const HeadGrid& grid_;
  std::uint32_t words_;  // of 128 bits a vector
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  static_assert(std::endian::native == std::endian::little);
  return std::make_unique<Writer>(machine, grid);
}

}  // namespace lamina::write::raw
