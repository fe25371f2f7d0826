#include "stages/program/fire.h"

#include <algorithm>
#include <cstring>

#include "stages/program/transpose.h"

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

/// Writes the same vector `count` times.
std::uint64_t* repeat(const std::uint64_t* vector, std::uint32_t words, std::uint64_t count, std::uint64_t* out) {
  constexpr std::uint64_t kBlock = 16;  // copied as one: 2 KiB for a head of 1000 nozzles
  const std::uint64_t singly = std::min(count, kBlock);
  const std::uint64_t* const block = out;
  for (std::uint64_t k = 0; k < singly; ++k) out = std::copy_n(vector, words, out);
  for (std::uint64_t left = count - singly; left > 0;) {
    const std::uint64_t now = std::min(left, kBlock);
    std::memcpy(out, block, now * words * sizeof(std::uint64_t));
    out += now * words;
    left -= now;
  }
  return out;
}

/// Appends a step that fires to the stretches.
void add_firing(std::uint32_t step, std::uint32_t count, Buffer<std::uint32_t>& firing) {
  if (!firing.empty() && firing.back() == step) {
    firing.back() += count;
  } else {
    firing.push_back(step);
    firing.push_back(step + count);
  }
}

// Every change of a line turns its nozzle on or off from a step on; steps of one residue belong together.
void fire_changes(const HeadGrid& grid, std::span<const ColumnChanges> lines, FireScratch& scratch, SweepVectors& vectors) {
  const std::uint32_t ticks = grid.steps_per_pixel, words = vectors.words;
  auto& offset = scratch.event_offset;
  offset.assign(std::size_t{vectors.steps} + 2, 0);
  const auto position_of = [&](std::uint32_t change, std::uint32_t lag) {
    return std::min(std::uint64_t{change} * ticks + lag - vectors.first_step, std::uint64_t{vectors.steps});
  };
  for (std::size_t l = 0; l < lines.size(); ++l) {
    for (const std::uint32_t change : lines[l]) ++offset[position_of(change, grid.lag[l % grid.nozzles]) + 1];
  }
  for (std::size_t s = 0; s + 1 < offset.size(); ++s) offset[s + 1] += offset[s];
  scratch.event_bit.resize(offset.back());
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const auto i = static_cast<std::uint32_t>(l % grid.nozzles);
    const std::size_t bit = (i ^ grid.bit_order) + l / grid.nozzles * grid.words() * 64;
    for (const std::uint32_t change : lines[l]) {
      scratch.event_bit[offset[position_of(change, grid.lag[i])]++] = static_cast<std::uint16_t>(bit);
    }
  }
  // Filling moved each offset to the end of its step.
  scratch.current.assign(std::size_t{ticks} * words, 0);
  scratch.lit.assign(ticks, 0);
  const std::uint16_t* event = scratch.event_bit.data();
  const std::uint16_t* const events = event;
  std::uint32_t residue = vectors.first_step % ticks;
  std::uint64_t* out = vectors.bits.data();
  for (std::uint32_t s = 0; s < vectors.steps;) {
    std::uint64_t* current = scratch.current.data() + std::size_t{residue} * words;
    std::uint32_t& lit = scratch.lit[residue];
    for (const std::uint16_t* const stop = events + offset[s]; event != stop; ++event) {
      const std::uint64_t bit = std::uint64_t{1} << (*event % 64);
      std::uint64_t& word = current[*event / 64];
      word ^= bit;
      lit += (word & bit) != 0 ? 1u : ~0u;
    }
    // Where steps are pixels the vector stays until something changes.
    std::uint32_t next = s + 1;
    while (ticks == 1 && next < vectors.steps && offset[next] == offset[s]) ++next;
    out = repeat(current, words, next - s, out);
    if (lit != 0) add_firing(s, next - s, vectors.firing);
    s = next;
    if (++residue == ticks) residue = 0;
  }
}

void fire_blocks(const HeadGrid& grid, std::span<const ColumnChanges> lines, FireScratch& scratch, SweepVectors& vectors) {
  const std::uint32_t ticks = grid.steps_per_pixel, words = vectors.words;
  std::fill(vectors.bits.begin(), vectors.bits.end(), 0);
  const std::uint64_t end_step = std::uint64_t{vectors.first_step} + vectors.steps;
  // Steps of residue r are r + ticks * q; bits of a row count q from `base`.
  const std::uint64_t base = vectors.first_step / ticks / 64 * 64;
  const std::size_t row_words = (end_step / ticks + 1 - base) / 64 + 1;
  scratch.rows.resize(row_words * 64);
  for (std::uint32_t word = 0; word < words; ++word) {
    for (std::uint32_t residue = 0; residue < ticks; ++residue) {
      std::uint64_t from = UINT64_MAX, to = 0;  // q
      std::fill(scratch.rows.begin(), scratch.rows.end(), 0);
      for (std::uint32_t bit = 0; bit < 64; ++bit) {
        const std::uint32_t nozzle = (word % grid.words() * 64 + bit) ^ grid.bit_order;
        if (nozzle >= grid.nozzles || grid.lag[nozzle] % ticks != residue) continue;
        const ColumnChanges line = lines[word / grid.words() * grid.nozzles + nozzle];
        if (line.empty()) continue;
        const std::uint64_t shift = grid.lag[nozzle] / ticks - base;
        std::uint64_t* const row = scratch.rows.data() + bit * row_words;
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
  const std::uint64_t* vector = vectors.bits.data();
  for (std::uint32_t s = 0; s < vectors.steps; ++s, vector += words) {
    std::uint64_t any = 0;
    for (std::uint32_t w = 0; w < words; ++w) any |= vector[w];
    if (any != 0) add_firing(s, 1, vectors.firing);
  }
}

}  // namespace

bool fire(const HeadGrid& grid, std::span<const ColumnChanges> lines, FireScratch& scratch, SweepVectors& vectors,
          FireWay way) {
  const std::uint64_t ticks = grid.steps_per_pixel;
  std::uint64_t first = UINT64_MAX, last = 0, changes = 0;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const ColumnChanges line = lines[l];
    if (line.empty()) continue;
    const std::uint64_t lag = grid.lag[l % grid.nozzles];
    first = std::min(first, line.front() * ticks + lag);
    last = std::max(last, (line.back() - 1) * ticks + lag);
    changes += line.size();
  }
  vectors.words = grid.words() * grid.drop_bits;
  vectors.firing.clear();
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
