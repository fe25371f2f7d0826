#include "tests/commands/unpack_runs.h"

#include <zlib.h>

#include <algorithm>
#include <array>

#include "stages/data/buffer.h"

namespace lamina::test {
namespace {

std::int64_t unfolded(std::uint64_t value) {
  const auto half = static_cast<std::int64_t>(value / 2);
  return value % 2 != 0 ? -half - 1 : half;
}

class CodeReader {
 public:
  explicit CodeReader(std::span<const std::byte> code) : code_(code) {}
  std::uint64_t number() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 56; shift += 7) {
      if (at_ == code_.size()) break;
      const auto byte = static_cast<std::uint64_t>(code_[at_++]);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    good_ = false;
    return 0;
  }
  /// Of a run: how far its begin and its end move.
  std::array<std::int64_t, 2> movements() {
    if (stay_ > 0 && stay_-- > 0) return {};
    if (at_ == code_.size()) good_ = false;
    if (!good_) return {};
    const auto pair = static_cast<std::uint64_t>(code_[at_++]);
    if (pair < 225) return {unfolded(pair / 15), unfolded(pair % 15)};
    if (pair < 255) {
      stay_ = pair - 224;
      return {};
    }
    const std::int64_t begin = unfolded(number());
    return {begin, unfolded(number())};
  }
  bool stays() const { return stay_ > 0; }  // more runs than were read
  bool good() const { return good_; }
  bool ended() const { return good_ && at_ == code_.size(); }

 private:
  std::span<const std::byte> code_;
  std::size_t at_ = 0;
  std::uint64_t stay_ = 0;  // runs
  bool good_ = true;
};

bool inflate_bytes(std::span<const std::byte> packed, Buffer<std::byte>& bytes) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return false;
  stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  int state = Z_OK;
  std::byte piece[16384];
  while (state == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(piece);
    stream.avail_out = sizeof piece;
    state = inflate(&stream, Z_NO_FLUSH);
    bytes.insert(bytes.end(), piece, piece + (sizeof piece - stream.avail_out));
  }
  const bool whole = state == Z_STREAM_END && stream.avail_in == 0;
  inflateEnd(&stream);
  return whole;
}

}  // namespace

Result<Runs> unpack_runs(std::span<const std::byte> packed, std::uint32_t columns, std::uint32_t rows) {
  const Error wrong{Fault::kVerification, "is no code of an image of this size"};
  Buffer<std::byte> code;
  if (!inflate_bytes(packed, code)) return wrong;
  CodeReader reader(code);
  Runs runs;
  runs.columns = columns;
  runs.row_offset.push_back(0);
  std::size_t first = 0, last = 0;  // the row before
  while (runs.row_offset.size() <= rows) {
    const std::uint64_t tag = reader.number();
    const std::uint64_t again = tag == 0 ? reader.number() : 1;
    if (!reader.good() || again > rows - (runs.row_offset.size() - 1)) return wrong;
    for (std::uint64_t k = 0; k < again; ++k) {
      const std::size_t begin = runs.change.size();
      const std::uint64_t count = tag < 2 ? last - first : tag - 2;
      if (count > columns + std::uint64_t{1} || count % 2 != 0) return wrong;
      std::int64_t column = -1;
      std::array<std::int64_t, 2> moved{};
      for (std::size_t i = 0; i < count; ++i) {
        std::int64_t next = 0;
        if (tag < 2) {
          if (tag == 1 && i % 2 == 0) moved = reader.movements();
          next = runs.change[first + i] + moved[i % 2];
        } else {
          next = std::max<std::int64_t>(column, 0) + static_cast<std::int64_t>(reader.number());
        }
        if (!reader.good() || next <= column || next > columns) return wrong;
        runs.change.push_back(static_cast<std::uint32_t>(next));
        column = next;
      }
      if (reader.stays()) return wrong;
      first = begin;
      last = runs.change.size();
      runs.row_offset.push_back(static_cast<std::uint32_t>(last));
    }
    if (again == 0) return wrong;
  }
  if (!reader.ended()) return wrong;
  return runs;
}

}  // namespace lamina::test
