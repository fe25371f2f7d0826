#include "stages/formats/png/image_data.h"

#include <algorithm>
#include <span>

#include "stages/formats/g4/empty_rows.h"
#include "stages/formats/png/chunk.h"
#include "stages/formats/png/deflate.h"
#include "stages/formats/png/filtered_rows.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::png {
namespace {

// zlib's header (RFC 1950, 2.2): deflate, a window of 32 KiB, no dictionary, the fastest level.
constexpr std::uint32_t kZlibHeader = 0x0178;

// White rows are cut here, so that a chunk is bounded for any image: 1 bit or more for 258 of them.
constexpr std::uint64_t kMaxZeros = std::uint64_t{1} << 22;

/// The memory into which chunks are written.
class Chunks {
 public:
  Chunks(Bytes& file, std::size_t start) : file_(file), chunk_(start) {
    const std::size_t minimum = start + kChunkHead + 4096;
    if (file_.size() < minimum) file_.resize(std::max(minimum, file_.capacity()));
    limit_ = limit();
  }

  std::byte* content() { return file_.data() + chunk_ + kChunkHead; }

  /// Closes a chunk that is long enough and makes room for `bytes` more.
  void ensure_capacity(BitWriter& out, std::size_t bytes) {
    if (out.next() + bytes > limit_) [[unlikely]]
      out = reserve_bytes(out, bytes);
  }

  std::size_t close(std::byte* end) {
    return static_cast<std::size_t>(close_chunk(file_.data() + chunk_, end, "IDAT") - file_.data());
  }

 private:
  [[gnu::noinline]] BitWriter reserve_bytes(BitWriter out, std::size_t bytes) {
    std::size_t used = static_cast<std::size_t>(out.next() - file_.data());
    if (used - chunk_ >= kChunkBytes) {
      grow(used, kChunkTail + kChunkHead + bytes);
      used = static_cast<std::size_t>(close_chunk(file_.data() + chunk_, file_.data() + used, "IDAT") - file_.data());
      chunk_ = used;
      used += kChunkHead;
    }
    grow(used, bytes);
    out.move_to(file_.data() + used);
    limit_ = limit();
    return out;
  }
  void grow(std::size_t used, std::size_t bytes) {
    bytes += kSlack;
    if (file_.size() - used < bytes) file_.resize(std::max(used + bytes, file_.size() * 2));
  }
  /// Where writing stops to think: at the end of the memory, or where the chunk is long enough.
  std::byte* limit() const { return file_.data() + std::min(file_.size() - kSlack, chunk_ + kChunkHead + kChunkBytes); }

  static constexpr std::size_t kSlack = 64;  // a store beyond the last byte, the stream's check, the chunk's

  Bytes& file_;
  std::size_t chunk_;
  std::byte* limit_;
};

void put_block_head(BitWriter& out, const BlockHead& head) {
  for (std::uint32_t bit = 0; bit < head.bits; bit += 32) out.put(head.words[bit / 32], std::min(head.bits - bit, 32u));
}

/// Zeros that wait before row `r`, but for so many.
void put_zero_run(BitWriter& out, Chunks& chunks, FilteredRows& rows, std::uint32_t r, std::uint64_t max_left) {
  for (std::uint64_t zeros = rows.waiting(r); zeros > max_left; zeros = rows.waiting(r)) {
    zeros = std::min(zeros, kMaxZeros);
    chunks.ensure_capacity(out, FilteredRows::max_bytes_of_zeros(zeros));
    rows.put_zeros(out, zeros);
  }
}

}  // namespace

std::size_t put_image_data(const RunsView& runs, Bytes& file, std::size_t start) {
  const std::uint32_t rows = runs.rows();
  const Table& table = table_for(row_bytes(runs.columns) * rows, runs.change.size());
  Chunks chunks(file, start);
  BitWriter out(chunks.content());
  out.put(kZlibHeader, 16);
  put_block_head(out, table.head);

  FilteredRows filtered(table.codes, runs.columns, rows);
  std::span<const std::uint32_t> above;  // the row above the first one is white (9.2)
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::span<const std::uint32_t> row = runs.row(r);
    if (row.empty()) {
      r = g4::end_of_empty_rows(runs.row_offset, r) - 1;
    } else {
      put_zero_run(out, chunks, filtered, r, FilteredRows::kMaxWaiting);
      chunks.ensure_capacity(out, filtered.max_bytes(row.size() + above.size()));
      filtered.put(out, r, row, above);
    }
    above = row;
  }
  put_zero_run(out, chunks, filtered, rows, 0);
  chunks.ensure_capacity(out, 16);
  out.put(table.codes.end);
  return chunks.close(put_number(out.finish(), filtered.check()));
}

}  // namespace lamina::formats::png
