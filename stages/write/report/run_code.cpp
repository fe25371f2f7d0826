#include "stages/write/report/run_code.h"

#include <zlib.h>

#include <algorithm>

namespace lamina::write::report {
namespace {

void add_number(std::uint64_t value, Buffer<std::byte>& code) {
  for (; value > 127; value >>= 7) code.push_back(static_cast<std::byte>(128 | (value & 127)));
  code.push_back(static_cast<std::byte>(value));
}

std::uint64_t folded(std::int64_t value) {
  return value < 0 ? 2 * static_cast<std::uint64_t>(-value) - 1 : 2 * static_cast<std::uint64_t>(value);
}
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
  bool good() const { return good_; }
  bool ended() const { return good_ && at_ == code_.size(); }

 private:
  std::span<const std::byte> code_;
  std::size_t at_ = 0;
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

Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  Buffer<std::byte> packed(size);
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
            static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION);
  packed.resize(size);
  return packed;
}

Buffer<std::byte> pack_runs(const RunsView& runs) {
  Buffer<std::byte> code;
  std::span<const std::uint32_t> before;
  std::uint32_t same = 0;
  const auto flush = [&] {
    if (same == 0) return;
    add_number(0, code);
    add_number(same, code);
    same = 0;
  };
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const std::span<const std::uint32_t> row = runs.row(r);
    if (std::ranges::equal(row, before)) {
      ++same;
    } else if (row.size() == before.size()) {
      flush();
      add_number(1, code);
      for (std::size_t i = 0; i < row.size(); ++i) add_number(folded(std::int64_t{row[i]} - before[i]), code);
    } else {
      flush();
      add_number(2 + row.size(), code);
      std::uint32_t column = 0;
      for (const std::uint32_t change : row) {
        add_number(change - column, code);
        column = change;
      }
    }
    before = row;
  }
  flush();
  return deflate_bytes(code);
}

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
      for (std::size_t i = 0; i < count; ++i) {
        std::int64_t next = 0;
        if (tag < 2) {
          next = runs.change[first + i] + (tag == 1 ? unfolded(reader.number()) : 0);
        } else {
          next = std::max<std::int64_t>(column, 0) + static_cast<std::int64_t>(reader.number());
        }
        if (!reader.good() || next <= column || next > columns) return wrong;
        runs.change.push_back(static_cast<std::uint32_t>(next));
        column = next;
      }
      first = begin;
      last = runs.change.size();
      runs.row_offset.push_back(static_cast<std::uint32_t>(last));
    }
    if (again == 0) return wrong;
  }
  if (!reader.ended()) return wrong;
  return runs;
}

std::string base64(std::span<const std::byte> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < have ? static_cast<std::uint32_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k) text += k <= have ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace lamina::write::report
