#include "stages/formats/zip/zip.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <memory>

namespace lamina::formats {

Status deflate_onto(Deflated& out, std::string_view text) {
  if (text.empty()) return {};
  const Error no_memory{Fault::kOutput, "no memory is left to compress a package"};
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK) return no_memory;
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, deflateEnd);
  Buffer<std::byte> capacity(std::size_t{64} << 10);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t count = std::min(text.size() - at, std::size_t{1} << 30);
    auto* const input = reinterpret_cast<const Bytef*>(text.data() + at);
    out.crc = static_cast<std::uint32_t>(crc32(out.crc, input, static_cast<uInt>(count)));
    stream.next_in = const_cast<Bytef*>(input);
    stream.avail_in = static_cast<uInt>(count);
    at += count;
    do {
      stream.next_out = reinterpret_cast<Bytef*>(capacity.data());
      stream.avail_out = static_cast<uInt>(capacity.size());
      if (deflate(&stream, at == text.size() ? Z_FULL_FLUSH : Z_NO_FLUSH) == Z_STREAM_ERROR) return no_memory;
      out.bytes.insert(out.bytes.end(), capacity.begin(), capacity.end() - stream.avail_out);
    } while (stream.avail_out == 0);
  }
  out.size += text.size();
  return {};
}

namespace {

constexpr std::uint64_t kDeflated = 8, kUtf8 = 1 << 11;                     // method; flag of names
constexpr std::array<std::byte, 2> kLastBlock{std::byte{3}, std::byte{0}};  // of a deflate stream: final, fixed codes, empty

void put_little(std::string& out, std::uint64_t number, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(number >> (8 * i) & 0xff);
}

}  // namespace

Result<ZipDate> zip_date(const char* text) {
  const std::string_view digits = text == nullptr ? "" : text;
  if (digits.empty()) return kFirstZipDate;
  std::uint64_t seconds = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), seconds);
  if (status != std::errc() || end != digits.data() + digits.size())
    return Error{Fault::kUsage, "SOURCE_DATE_EPOCH is not a count of seconds since 1970, such as 1767225600; unset it"};
  constexpr std::uint64_t kFirst = 315'532'800, kLast = 4'354'819'198;  // 1980-01-01 0:00:00, 2107-12-31 23:59:58
  const std::chrono::sys_seconds time{std::chrono::seconds(std::clamp(seconds, kFirst, kLast))};
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(time - day);
  const auto years = static_cast<ZipDate>(static_cast<int>(date.year()) - 1980);
  const ZipDate on = years << 9 | static_cast<unsigned>(date.month()) << 5 | static_cast<unsigned>(date.day());
  const auto at =
      static_cast<ZipDate>(clock.hours().count() << 11 | clock.minutes().count() << 5 | clock.seconds().count() / 2);
  return on << 16 | at;
}

/// What stands before the data of an entry, and again in the directory, with the entry's place.
std::string ZipWriter::record(const Entry& entry, bool in_directory) const {
  const bool large_sizes = large(entry.packed) || large(entry.size), large_offset = in_directory && large(entry.position);
  const int version = large_sizes || large_offset ? 45 : 20;
  std::string extra;
  if (large_sizes || large_offset) {
    put_little(extra, 1, 2);
    put_little(extra, (large_sizes ? 16 : 0) + (large_offset ? 8 : 0), 2);
    if (large_sizes) put_little(extra, entry.size, 8), put_little(extra, entry.packed, 8);
    if (large_offset) put_little(extra, entry.position, 8);
  }
  std::string out = in_directory ? "PK\x01\x02" : "PK\x03\x04";
  if (in_directory) put_little(out, version, 2);  // made by
  put_little(out, version, 2);                    // needed to extract
  put_little(out, std::ranges::any_of(entry.name, [](char c) { return c < 0; }) ? kUtf8 : 0, 2);
  put_little(out, entry.stored ? 0 : kDeflated, 2);
  put_little(out, date_, 4);
  put_little(out, entry.crc, 4);
  put_little(out, large_sizes ? UINT32_MAX : entry.packed, 4);
  put_little(out, large_sizes ? UINT32_MAX : entry.size, 4);
  put_little(out, entry.name.size(), 2);
  put_little(out, extra.size(), 2);
  if (in_directory) {
    out.append(10, '\0');  // no comment, the first disk, no attributes
    put_little(out, large_offset ? UINT32_MAX : entry.position, 4);
  }
  return out + entry.name + extra;
}

Status ZipWriter::add(std::string_view name, std::span<const Deflated> pieces) {
  Entry entry{std::string(name), 0, kLastBlock.size(), 0, written_};
  for (const Deflated& piece : pieces) {
    entry.crc = static_cast<std::uint32_t>(crc32_combine(entry.crc, piece.crc, static_cast<z_off_t>(piece.size)));
    entry.packed += piece.bytes.size();
    entry.size += piece.size;
  }
  const std::string head = record(entry, false);
  if (Status status = file_.append(head); !status) return status;
  for (const Deflated& piece : pieces) {
    if (Status status = file_.append(piece.bytes); !status) return status;
  }
  written_ += head.size() + entry.packed;
  entries_.push_back(std::move(entry));
  return file_.append(kLastBlock);
}

std::uint32_t crc_of(std::span<const std::byte> bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

Status ZipWriter::store(std::string_view name, std::span<const std::byte> bytes, std::uint32_t crc) {
  Entry entry{std::string(name), crc, bytes.size(), bytes.size(), written_, true};
  const std::string head = record(entry, false);
  if (Status status = file_.append(head); !status) return status;
  written_ += head.size() + bytes.size();
  entries_.push_back(std::move(entry));
  return file_.append(bytes);
}

void ZipWriter::keep(const ContainerEntry& entry, std::uint64_t end) {
  entries_.push_back({entry.name, entry.crc, entry.bytes, entry.bytes, entry.header, true});
  written_ = end;
}

Status ZipWriter::finish() {
  std::string directory;
  for (const Entry& entry : entries_) directory += record(entry, true);
  const std::uint64_t count = entries_.size(), position = written_, size = directory.size();
  if (large(position) || large(size) || count >= UINT16_MAX) {
    const std::uint64_t end = position + size;
    directory += "PK\x06\x06";
    put_little(directory, 44, 8);  // bytes that follow in this record
    put_little(directory, 45, 2);
    put_little(directory, 45, 2);
    put_little(directory, 0, 8);  // the only disk
    put_little(directory, count, 8);
    put_little(directory, count, 8);
    put_little(directory, size, 8);
    put_little(directory, position, 8);
    directory += "PK\x06\x07";
    put_little(directory, 0, 4);
    put_little(directory, end, 8);
    put_little(directory, 1, 4);
  }
  directory += "PK\x05\x06";
  put_little(directory, 0, 4);
  for (int i = 0; i < 2; ++i) put_little(directory, std::min<std::uint64_t>(count, UINT16_MAX), 2);
  put_little(directory, large(size) ? UINT32_MAX : size, 4);
  put_little(directory, large(position) ? UINT32_MAX : position, 4);
  put_little(directory, 0, 2);
  return file_.append(directory);
}

}  // namespace lamina::formats
