#include "stages/formats/tiff/pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/support/io/file_reader.h"

namespace lamina::formats::tiff {
namespace {

constexpr std::uint16_t kAscii = 2, kShort = 3, kLong = 4, kLong8 = 16, kStripOffsets = 273;
constexpr std::uint16_t kTileOffsets = 324, kSubDirectories = 330;  // of files that no encoder of layers writes
constexpr std::uint64_t kMaxEntries = 100, kMaxStrips = 1 << 22;

/// Bytes of a value of the types of TIFF 6.0; 0 for others.
std::uint64_t size_of_type(std::uint16_t type) {
  constexpr std::array<std::uint8_t, 13> kSizes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};
  return type < kSizes.size() ? kSizes[type] : 0;
}

std::uint64_t little_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  std::memcpy(&value, bytes.data() + at, count);
  return value;
}

void put_number(std::string& to, std::uint64_t value, std::size_t bytes) {
  to.append(reinterpret_cast<const char*>(&value), bytes);
}

/// An entry of the directory of a page.
struct PageEntry {
  std::uint16_t tag = 0, type = 0;
  std::uint64_t count = 0;
  std::string value;         // its bytes
  bool in_file = false;      // `offset` leads to the value in the image's file
  std::uint64_t offset = 0;  // in that file
};

/// The numbers of an array in the image's file, SHORT or LONG.
std::optional<std::vector<std::uint64_t>> read_offsets(std::string_view entry, const ReadBytes& file) {
  const auto type = static_cast<std::uint16_t>(little_endian(entry, 2, 2));
  const std::uint64_t count = little_endian(entry, 4, 4), size = size_of_type(type);
  if ((type != kShort && type != kLong) || count == 0 || count > kMaxStrips) return std::nullopt;
  std::string bytes(entry.substr(8, 4));
  if (count * size > 4) {
    bytes.resize(static_cast<std::size_t>(count * size));
    if (!file(little_endian(entry, 8, 4), bytes)) return std::nullopt;
  }
  std::vector<std::uint64_t> offsets(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = little_endian(bytes, i * size, size);
  return offsets;
}

/// The entries of the image's file; strips  the offsets in it. false: it is none
bool read_entries(const ReadBytes& file, bool big, std::vector<PageEntry>& entries, std::vector<std::uint64_t>& strips) {
  std::string bytes(8, '\0');
  if (!file(0, bytes) || !bytes.starts_with(std::string_view("II\x2a\0", 4))) return false;
  const std::uint64_t directory = little_endian(bytes, 4, 4);
  bytes.resize(2);
  if (!file(directory, bytes)) return false;
  const std::uint64_t count = little_endian(bytes, 0, 2);
  bytes.resize(static_cast<std::size_t>(count) * 12);
  if (count > kMaxEntries || !file(directory + 2, bytes)) return false;
  const std::uint64_t inline_bytes = big ? 8 : 4;
  for (std::string_view rest = bytes; !rest.empty(); rest.remove_prefix(12)) {
    PageEntry entry{static_cast<std::uint16_t>(little_endian(rest, 0, 2)),
                    static_cast<std::uint16_t>(little_endian(rest, 2, 2)),
                    little_endian(rest, 4, 4),
                    {}};
    const std::uint64_t size = size_of_type(entry.type) * entry.count;
    if (size == 0 || entry.tag == kTileOffsets || entry.tag == kSubDirectories || entry.tag >= kFileRangeTag) return false;
    if (entry.tag == kStripOffsets) {
      auto offsets = read_offsets(rest, file);
      if (!offsets) return false;
      strips = std::move(*offsets);
    } else if (size > inline_bytes) {
      entry.in_file = true;
      entry.offset = little_endian(rest, 8, 4);
    } else if (size > 4) {
      entry.value.resize(static_cast<std::size_t>(size));
      if (!file(little_endian(rest, 8, 4), entry.value)) return false;
    } else {
      entry.value = rest.substr(8, static_cast<std::size_t>(size));
    }
    entries.push_back(std::move(entry));
  }
  return !strips.empty();
}

/// Lays out the directory of a page and its values.
class HeadLayout {
 public:
  HeadLayout(const PageContent& content, bool big, std::vector<PageEntry> entries)
      : content_(content), big_(big), sizes_(tiff_sizes(big)), entries_(std::move(entries)) {
    add_range(kFileRangeTag, 0, content.bytes);
    add_name(kFileNameTag, content.name);
    if (content.program.empty()) return;
    add_range(kProgramRangeTag, content.program_offset, content.program_bytes);
    add_name(kProgramNameTag, content.program);
  }

  std::string write(std::uint64_t page, const std::vector<std::uint64_t>& strips) {
    const std::size_t number = sizes_.offset;
    const std::uint64_t values = page + sizes_.count + entries_.size() * sizes_.entry + sizes_.offset;
    // The private values come first: a reader of the pages gets them with the directory.
    std::uint64_t end = values;
    const auto reserve = [&](PageEntry& entry, std::uint64_t bytes) {
      entry.offset = end;
      end += bytes + bytes % 2;  // TIFF 6.0: values begin at even offsets
    };
    PageEntry* strip_entry = nullptr;
    for (PageEntry& entry : entries_) {
      if (entry.tag == kStripOffsets) strip_entry = &entry;
      if (entry.tag >= kFileRangeTag) reserve(entry, entry.value.size());
    }
    strip_entry->type = big_ ? kLong8 : kLong;
    strip_entry->value.assign(strips.size() * number, '\0');
    if (strips.size() > 1) reserve(*strip_entry, strip_entry->value.size());
    const std::uint64_t file = page_aligned(end);
    set_numbers(*strip_entry, strips, file);
    for (PageEntry& entry : entries_) {
      if (entry.tag == kFileRangeTag) set_numbers(entry, {file, content_.bytes}, 0);
      if (entry.in_file) entry.offset += file;
    }
    return text(values, file - page, page_aligned(file + content_.bytes));
  }

 private:
  void add_range(std::uint16_t tag, std::uint64_t offset, std::uint64_t bytes) {
    PageEntry entry{tag, big_ ? kLong8 : kLong, 2, {}};
    entry.value.resize(2 * sizes_.offset);
    set_numbers(entry, {offset, bytes}, 0);
    entries_.push_back(std::move(entry));
  }
  void add_name(std::uint16_t tag, const std::string& name) { entries_.push_back({tag, kAscii, name.size() + 1, name + '\0'}); }
  void set_numbers(PageEntry& entry, const std::vector<std::uint64_t>& numbers, std::uint64_t added) const {
    entry.value.clear();
    for (const std::uint64_t one : numbers) put_number(entry.value, one + added, sizes_.offset);
  }
  std::string text(std::uint64_t values, std::uint64_t bytes, std::uint64_t next) const {
    std::string head;
    put_number(head, entries_.size(), sizes_.count);
    for (const PageEntry& entry : entries_) {
      put_number(head, entry.tag, 2);
      put_number(head, entry.type, 2);
      put_number(head, entry.count, sizes_.offset);
      if (entry.in_file || entry.value.size() > sizes_.offset) {
        put_number(head, entry.offset, sizes_.offset);
      } else {
        head += entry.value;
        head.append(sizes_.offset - entry.value.size(), '\0');
      }
    }
    put_number(head, next, sizes_.offset);
    const std::uint64_t page = values - head.size();
    head.resize(static_cast<std::size_t>(bytes));
    for (const PageEntry& entry : entries_) {
      if (entry.in_file || entry.value.size() <= sizes_.offset) continue;
      std::ranges::copy(entry.value, head.begin() + static_cast<std::ptrdiff_t>(entry.offset - page));
    }
    return head;
  }

  const PageContent& content_;
  bool big_;
  TiffSizes sizes_;
  std::vector<PageEntry> entries_;
};

/// The header of the file. BigTIFF: version 43, offsets of 8 bytes, the first directory right after it.
std::string header(bool big) {
  std::string text = big ? std::string("II\x2b\0\x08\0\0\0", 8) : std::string("II\x2a\0", 4);
  put_number(text, tiff_sizes(big).header, tiff_sizes(big).offset);
  return text;
}

}  // namespace

Result<std::string> page_head(const PageContent& content, std::uint64_t offset, bool big, const ReadBytes& file) {
  std::vector<PageEntry> entries;
  std::vector<std::uint64_t> strips;
  if (!read_entries(file, big, entries, strips))
    return Error{Fault::kVerification, fmt::format("{}: is no TIFF file of a layer", content.name)};
  std::string head = HeadLayout(content, big, std::move(entries)).write(offset, strips);
  const std::uint64_t end = page_aligned(offset + head.size() + content.bytes);
  if (!big && std::max(end, content.program_offset + content.program_bytes) > UINT32_MAX)
    return Error{Fault::kOutput, fmt::format("{}: ends beyond the 4 GiB of a classic TIFF file", content.name)};
  return head;
}

Status PageWriter::add(const PageContent& content, std::span<const std::byte> image) {
  if (file_.size() == 0) {
    if (Status status = file_.append(header(big_)); !status) return status;
  }
  const std::uint64_t offset = file_.size();
  const auto head = page_head(content, offset, big_, [&](std::uint64_t at, std::span<char> to) {
    if (at > image.size() || to.size() > image.size() - at) return false;
    std::memcpy(to.data(), image.data() + at, to.size());
    return true;
  });
  if (!head) return head.error();
  last_directory_ = offset;
  last_entries_ = little_endian(*head, 0, tiff_sizes(big_).count);
  Status status = file_.append(*head);
  if (status) status = file_.append(image);
  constexpr std::string_view kZeros("\0\0\0\0\0\0\0", 7);
  return status ? file_.append(kZeros.substr(0, page_aligned(image.size()) - image.size())) : status;
}

Status PageWriter::put_next(std::uint64_t offset) {
  const TiffSizes sizes = tiff_sizes(big_);
  std::string text;
  put_number(text, offset, sizes.offset);
  return file_.overwrite(last_directory_ + sizes.count + last_entries_ * sizes.entry, std::as_bytes(std::span(text)));
}

Status PageWriter::keep(const JobPage& page) {
  last_directory_ = page.directory;
  last_entries_ = page.entries;
  return put_next(page.end());
}

Status PageWriter::finish() { return last_directory_ == 0 ? file_.append(header(big_)) : put_next(0); }

std::string fault_of_page(const FileReader& pages, const JobPage& page, bool big) {
  const std::string& name = page.content.name;
  const auto head = page_head(page.content, page.directory, big, [&](std::uint64_t at, std::span<char> to) {
    return at <= page.content.bytes && to.size() <= page.content.bytes - at && pages.read_at(page.file + at, to);
  });
  if (!head) return head.error().message;
  std::string found(head->size(), '\0'), expected = *head;
  std::string padding(static_cast<std::size_t>(page.end() - page.file - page.content.bytes), '\0');
  const bool read = pages.read_at(page.directory, found) && pages.read_at(page.file + page.content.bytes, padding);
  if (page.next == 0) {  // of the last page
    const TiffSizes sizes = tiff_sizes(big);
    expected.replace(sizes.count + page.entries * sizes.entry, sizes.offset, std::string(sizes.offset, '\0'));
  }
  const bool same = read && found == expected && padding.find_first_not_of('\0') == std::string::npos;
  return same ? "" : fmt::format("{}: the directory of its page in {} is not what was written", name, kPagesFile);
}

std::string fault_of_pages(const std::string& path) {
  const auto pages = read_pages(path);
  if (!pages) return pages.error().message;
  const auto file = FileReader::open(path, {});
  if (!file) return file.error().message;
  std::vector<std::string_view> names;
  for (const JobPage& page : pages->pages) {
    if (std::string fault = fault_of_page(*file, page, pages->big); !fault.empty()) return fault;
    names.push_back(page.content.name);
  }
  std::ranges::sort(names);
  if (const auto twice = std::ranges::adjacent_find(names); twice != names.end())
    return fmt::format("{}: is in two pages of {}", *twice, kPagesFile);
  return pages->fault.empty() ? "" : fmt::format("{}: {}", kPagesFile, pages->fault);
}

}  // namespace lamina::formats::tiff
