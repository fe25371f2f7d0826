// stages/program/binary_program.h: what binary dialects have in common: numbers, segments, records of head maintenance.
#pragma once

#include <bit>
#include <cstring>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "stages/program/dialect.h"
#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"

namespace lamina::program {

/// Appends numbers of 32 bits, lowest byte first.
inline void put_numbers(ProgramBytes& out, std::span<const std::uint32_t> numbers) {
  static_assert(std::endian::native == std::endian::little);
  const auto bytes = std::as_bytes(numbers);
  out.insert(out.end(), bytes.begin(), bytes.end());
}
inline void put_numbers(ProgramBytes& out, std::initializer_list<std::uint32_t> numbers) {
  put_numbers(out, std::span(numbers.begin(), numbers.size()));
}

/// The vats that feed a layer, a bit each.
inline std::uint32_t vat_bits(const LayerCycle& cycle) {
  std::uint32_t bits = 0;
  for (const std::uint32_t vat : cycle.feeds) bits |= 1u << vat;
  return bits;
}

/// Calls visit(place, count) for stretches of steps without a gap of zeros that would cost more than a segment's head:
/// places count from the first step of the vectors, in increasing order. cost  O(stretches that fire)
template <class Visit>
void for_each_segment(const SweepVectors& vectors, std::size_t head_bytes, std::size_t vector_bytes, const Visit& visit) {
  const std::size_t widest_gap = head_bytes / vector_bytes;
  const auto& firing = vectors.firing;
  for (std::size_t i = 0; i < firing.size();) {
    const std::uint32_t begin = firing[i];
    for (i += 2; i < firing.size() && firing[i] - firing[i - 1] <= widest_gap;) i += 2;
    visit(begin, firing[i - 1] - begin);
  }
}

/// Appends the segments of a sweep in the order of the movement: for each one its head, kHead bytes that
/// head(to, place, count) writes, and its vectors as they stand in `vectors.bits`, whose order is that of the dialect
/// (Dialect::bit_order), cut off at vector_bytes.
/// turn    vectors of a segment run downwards
/// planes  a step's vectors are so many, and a segment has those of all its steps plane after plane
template <std::size_t kHead, class Head>
void put_segments(const SweepVectors& vectors, bool backward, bool turn, std::size_t vector_bytes, ProgramBytes& out,
                  const Head& head, std::uint32_t planes = 1) {
  std::size_t end = out.size();
  const std::size_t step_bytes = vector_bytes * planes;
  for_each_segment(vectors, kHead, step_bytes, [&](std::uint32_t, std::uint32_t count) { end += kHead + count * step_bytes; });
  std::size_t next = backward ? end : out.size();
  out.resize(end);
  const std::size_t stride = vectors.words * sizeof(std::uint64_t), plane_stride = stride / planes;
  for_each_segment(vectors, kHead, step_bytes, [&](std::uint32_t position, std::uint32_t count) {
    const std::size_t bytes = kHead + count * step_bytes;
    if (backward) next -= bytes;
    std::byte* to = out.data() + next;
    head(to, position, count);
    to += kHead;
    const auto* from = reinterpret_cast<const std::byte*>(vectors.bits.data()) + position * stride;
    if (stride == vector_bytes && !turn) {
      std::memcpy(to, from, count * stride);
    } else {
      for (std::uint32_t p = 0; p < planes; ++p, from += plane_stride) {
        for (std::uint32_t k = 0; k < count; ++k, to += vector_bytes) {
          std::memcpy(to, from + (turn ? count - 1 - k : k) * stride, vector_bytes);
        }
      }
    }
    if (!backward) next += bytes;
  });
}

/// put_segments() for ProgramWriter::stream_sweep(), of vectors as long as in `vectors.bits` that do not turn.
template <std::size_t kHead, class Head>
Status stream_segments(const SweepVectors& vectors, bool backward, ProgramBytes& out, const ProgramWriter::Take& take,
                       const Head& head) {
  constexpr std::size_t kMaxCopied = 16 << 10;
  const std::size_t stride = vectors.words * sizeof(std::uint64_t);
  const auto bytes = std::as_bytes(std::span(vectors.bits));
  Buffer<std::uint32_t> segment;  // position and count of each
  for_each_segment(vectors, kHead, stride,
                   [&](std::uint32_t position, std::uint32_t count) { segment.push_back(position), segment.push_back(count); });
  for (std::size_t i = 0; i < segment.size(); i += 2) {
    const std::size_t at = backward ? segment.size() - 2 - i : i;
    out.resize(out.size() + kHead);
    head(out.data() + out.size() - kHead, segment[at], segment[at + 1]);
    const auto of_segment = bytes.subspan(segment[at] * stride, segment[at + 1] * stride);
    if (of_segment.size() <= kMaxCopied) {
      out.insert(out.end(), of_segment.begin(), of_segment.end());
    } else if (Status status = take(of_segment); !status) {
      return status;
    }
  }
  return {};
}

/// The position of nozzle 0 across the scan, of the carriage in nm.
inline std::int64_t across_nm(const Machine& machine, const HeadGrid& grid, std::int64_t line) {
  const double offset = machine.mounting.offset_mm[grid.scan_axis == ScanAxis::kX ? 1 : 0] * kNmPerMm;
  const double nm = grid.line_position_nm(line) + offset;
  return static_cast<std::int64_t>(nm + (nm < 0 ? -0.5 : 0.5));
}

/// What a record of head maintenance or powder states; the READMEs of raw and planes have the numbers that follow each.
enum class MaintenanceRecord : std::uint8_t { kGo, kFill, kBase, kRoller, kWipe, kShot, kDry, kOwn };

/// A writer whose head maintenance is records for the host, a layer's by that layer alone.
class BinaryWriter : public ProgramWriter {
 public:
  /// machine and grid outlive this object. ids  the first number of each record, by MaintenanceRecord
  BinaryWriter(const Machine& machine, const HeadGrid& grid, std::array<std::uint32_t, 8> ids)
      : machine_(machine), grid_(grid), carriage_(machine, grid), clock_(machine, shot_seconds(machine)), ids_(ids) {}

  void maintenance_of_layer(const LayerCycle& cycle, ProgramBytes& out) final;
  void maintenance_before(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) final;
  void maintenance_after(ProgramBytes& out) final;

 protected:
  const Machine& machine_;
  const HeadGrid& grid_;

 private:
  void serve(MaintenanceClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(MachinePoint to, ProgramBytes& out) const;
  void put(MaintenanceRecord kind, std::initializer_list<std::uint32_t> numbers, ProgramBytes& out) const;

  Carriage carriage_;
  MaintenanceClock clock_;
  std::array<std::uint32_t, 8> ids_;
};

}  // namespace lamina::program
