#include "stages/program/fire.h"

#include <algorithm>
#include <cstring>

#include "stages/program/transpose_bits.h"

namespace lamina::program {
namespace {

/// Sets bits [begin, end) of a row.
void set_bits(std::uint64_t* row, std::uint64_t begin, std::uint64_t end) {
  if (begin >= end) return;
  const std::uint64_t first = begin / 64, last = (end - 1) / 64;
  const std::uint64_t head = ~std::uint64_t{0} << (begin % 64), tail = ~std::uint64_t{0} >> (63 - (end - 1) % 64);
  if (first == last) {
    row[first] |= head & tail;
    return;
  }
  row[first] |= head;
  for (std::uint64_t word = first + 1; word < last; ++word) row[word] = ~std::uint64_t{0};
  row[last] |= tail;
}

// Every change of a line turns its nozzle on or off from a step on; steps of one residue belong together.
void fire_changes(const HeadGrid& grid, std::span<const Line> lines, FireScratch& scratch, SweepVectors& vectors) {
  const std::uint32_t ticks = grid.steps_per_pixel, words = vectors.words;
  auto& offset = scratch.event_offset;
  offset.assign(std::size_t{vectors.steps} + 2, 0);
  const auto place_of = [&](std::uint32_t change, std::uint32_t lag) {
    return std::min(std::uint64_t{change} * ticks + lag - vectors.first_step, std::uint64_t{vectors.steps});
  };
  for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
    for (const std::uint32_t change : lines[i]) ++offset[place_of(change, grid.lag[i]) + 1];
  }
  for (std::size_t s = 0; s + 1 < offset.size(); ++s) offset[s + 1] += offset[s];
  scratch.event_nozzle.resize(offset.back());
  for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
    for (const std::uint32_t change : lines[i]) {
      scratch.event_nozzle[offset[place_of(change, grid.lag[i])]++] = static_cast<std::uint16_t>(i);
    }
  }
  // Filling moved each offset to the end of its step.
  scratch.current.assign(std::size_t{ticks} * words, 0);
  const std::uint16_t* event = scratch.event_nozzle.data();
  const std::uint16_t* const events = event;
  std::uint32_t residue = vectors.first_step % ticks;
  std::uint64_t* out = vectors.bits.data();
  for (std::uint32_t s = 0; s < vectors.steps; ++s) {
    std::uint64_t* current = scratch.current.data() + std::size_t{residue} * words;
    for (const std::uint16_t* const stop = events + offset[s]; event != stop; ++event) {
      current[*event / 64] ^= std::uint64_t{1} << (*event % 64);
    }
    for (std::uint32_t w = 0; w < words; ++w) *out++ = current[w];
    if (++residue == ticks) residue = 0;
  }
}

void fire_blocks(const HeadGrid& grid, std::span<const Line> lines, FireScratch& scratch, SweepVectors& vectors) {
  const std::uint32_t ticks = grid.steps_per_pixel, words = vectors.words;
  std::fill(vectors.bits.begin(), vectors.bits.end(), 0);
  const std::uint64_t end_step = std::uint64_t{vectors.first_step} + vectors.steps;
  // Steps of residue r are r + ticks * q; bits of a row count q from `base`.
  const std::uint64_t base = vectors.first_step / ticks / 64 * 64;
  const std::size_t row_words = (end_step / ticks + 1 - base) / 64 + 1;
  scratch.rows.resize(row_words * 64);
  for (std::uint32_t word = 0; word < words; ++word) {
    const std::uint32_t first = word * 64, count = std::min<std::uint32_t>(64, grid.nozzles - first);
    for (std::uint32_t residue = 0; residue < ticks; ++residue) {
      std::uint64_t from = UINT64_MAX, to = 0;  // q
      std::fill(scratch.rows.begin(), scratch.rows.end(), 0);
      for (std::uint32_t i = 0; i < count; ++i) {
        const Line line = lines[first + i];
        const std::uint32_t lag = grid.lag[first + i];
        if (line.empty() || lag % ticks != residue) continue;
        const std::uint64_t shift = lag / ticks - base;
        std::uint64_t* const row = scratch.rows.data() + i * row_words;
        for (std::size_t c = 0; c + 1 < line.size(); c += 2) set_bits(row, line[c] + shift, line[c + 1] + shift);
        from = std::min(from, line.front() + shift);
        to = std::max(to, line.back() + shift);
      }
      for (std::uint64_t block = from / 64; block * 64 < to; ++block) {
        std::uint64_t square[64];
        std::uint64_t any = 0;
        for (std::uint32_t i = 0; i < 64; ++i) any |= square[i] = scratch.rows[i * row_words + block];
        if (any == 0) continue;
        transpose_64x64(square);
        for (std::uint32_t q = 0; q < 64; ++q) {
          if (square[q] == 0) continue;
          const std::uint64_t step = (base + block * 64 + q) * ticks + residue;
          vectors.bits[(step - vectors.first_step) * words + word] = square[q];
        }
      }
    }
  }
}

}  // namespace

bool fire(const HeadGrid& grid, std::span<const Line> lines, FireScratch& scratch, SweepVectors& vectors, FireWay way) {
  const std::uint64_t ticks = grid.steps_per_pixel;
  std::uint64_t first = UINT64_MAX, last = 0, changes = 0;
  for (std::uint32_t i = 0; i < grid.nozzles; ++i) {
    if (lines[i].empty()) continue;
    first = std::min(first, lines[i].front() * ticks + grid.lag[i]);
    last = std::max(last, (lines[i].back() - 1) * ticks + grid.lag[i]);
    changes += lines[i].size();
  }
  vectors.words = grid.words();
  if (changes == 0) {
    vectors.first_step = vectors.steps = 0;
    vectors.bits.clear();
    return false;
  }
  vectors.first_step = static_cast<std::uint32_t>(first);
  vectors.steps = static_cast<std::uint32_t>(last - first + 1);
  vectors.bits.resize(std::size_t{vectors.steps} * vectors.words);
  // A change costs about as much as a fiftieth of a block; a block is 64 lines by 64 pixels for each residue.
  const std::uint64_t blocks = std::uint64_t{vectors.words} * (vectors.steps / 64 + 1);
  const bool by_blocks = way == FireWay::kBlocks || (way == FireWay::kCheapest && changes > 50 * blocks);
  by_blocks ? fire_blocks(grid, lines, scratch, vectors) : fire_changes(grid, lines, scratch, vectors);
  return true;
}

}  // namespace lamina::program
