#include "stages/support/io/paged.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>

#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/recent_files.h"
#include "stages/support/io/temporary.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxDirectoryBytes = 4096;  // of a page's entries, and its private values right after them
constexpr std::uint16_t kAsciiType = 2, kLongType = 4, kLong8Type = 16;

std::uint64_t number_in(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  std::memcpy(&value, bytes.data() + at, count);
  return value;
}

/// Reads the private tags of a directory.
class DirectoryReader {
 public:
  /// text  of the file from `directory` on
  DirectoryReader(std::string_view text, std::uint64_t directory, bool big)
      : text_(text), directory_(directory), big_(big), sizes_(tiff_sizes(big)) {}

  bool read(JobPage& page) {
    if (text_.size() < sizes_.count) return false;
    const std::uint64_t entries = number_in(text_, 0, sizes_.count);
    if (entries > kMaxDirectoryBytes / sizes_.entry) return false;
    const std::size_t next = sizes_.count + static_cast<std::size_t>(entries) * sizes_.entry;
    if (text_.size() < next + sizes_.offset) return false;
    PageContent& content = page.content;
    bool right = true;
    for (std::size_t at = sizes_.count; at < next; at += sizes_.entry) {
      switch (number_in(text_, at, 2)) {
        case kFileRangeTag: right = right && read_range(at, page.file, content.bytes); break;
        case kFileNameTag: right = right && read_name(at, "layers/", content.name); break;
        case kProgramRangeTag: right = right && read_range(at, content.program_offset, content.program_bytes); break;
        case kProgramNameTag: right = right && read_name(at, "program/", content.program); break;
        default: break;
      }
    }
    page.directory = directory_;
    page.entries = entries;
    page.next = number_in(text_, next, sizes_.offset);
    return right && !content.name.empty() && page.file > directory_ && page.file % 8 == 0;
  }

 private:
  /// The bytes of a value of that type; empty if it is another one, or not among those that were read.
  std::string_view value(std::size_t entry, std::uint16_t type, std::size_t size) const {
    if (number_in(text_, entry + 2, 2) != type) return {};
    const std::uint64_t count = number_in(text_, entry + 4, sizes_.offset), bytes = count * size;
    if (count > kMaxDirectoryBytes || bytes <= sizes_.offset) return {};
    const std::uint64_t at = number_in(text_, entry + 4 + sizes_.offset, sizes_.offset) - directory_;
    if (at > text_.size() || bytes > text_.size() - at) return {};
    return text_.substr(static_cast<std::size_t>(at), static_cast<std::size_t>(bytes));
  }
  bool read_range(std::size_t entry, std::uint64_t& offset, std::uint64_t& bytes) const {
    const std::size_t size = big_ ? 8 : 4;
    const std::string_view numbers = value(entry, big_ ? kLong8Type : kLongType, size);
    if (numbers.size() != 2 * size) return false;
    offset = number_in(numbers, 0, size);
    bytes = number_in(numbers, size, size);
    return true;
  }
  bool read_name(std::size_t entry, std::string_view folder, std::string& name) const {
    const std::string_view text = value(entry, kAsciiType, 1);
    if (text.size() <= folder.size() + 1 || text.find('\0') != text.size() - 1 || !text.starts_with(folder)) return false;
    name = text.substr(0, text.size() - 1);
    return name.find('/', folder.size()) == std::string::npos && name.size() > folder.size();
  }

  std::string_view text_;
  std::uint64_t directory_;
  bool big_;
  TiffSizes sizes_;
};

bool has_pages_header(const FileReader& file, bool& big) {
  std::array<char, 16> head{};
  if (file.size() < 8 || !file.read_at(0, std::span(head).first(8))) return false;
  constexpr std::string_view kClassic("II\x2a\0\x08\0\0\0", 8), kBig("II\x2b\0\x08\0\0\0\x10\0\0\0\0\0\0\0", 16);
  big = std::string_view(head.data(), 8) == kBig.substr(0, 8);
  if (!big) return std::string_view(head.data(), 8) == kClassic;
  return file.size() >= 16 && file.read_at(0, head) && std::string_view(head.data(), 16) == kBig;
}

/// Reads the page at an offset; false if it is not whole.
bool read_page(const FileReader& file, std::uint64_t directory, bool big, std::string& scratch, JobPage& page) {
  if (directory >= file.size()) return false;
  scratch.resize(static_cast<std::size_t>(std::min<std::uint64_t>(file.size() - directory, kMaxDirectoryBytes)));
  if (!file.read_at(directory, scratch) || !DirectoryReader(scratch, directory, big).read(page)) return false;
  return page.content.bytes <= file.size() && page.file <= file.size() && page.end() <= file.size();
}

PageList walk_pages(const FileReader& file, bool unfinished, std::size_t maximum = SIZE_MAX) {
  PageList found;
  if (!has_pages_header(file, found.big)) {
    if (!unfinished) found.fault = "is no TIFF file with the layers of a job";
    return found;
  }
  std::string scratch;
  for (std::uint64_t at = tiff_sizes(found.big).header; at != 0 && found.pages.size() < maximum; at = found.pages.back().next) {
    JobPage page;
    const bool whole = read_page(file, at, found.big, scratch, page);
    // The next directory is right after a page: no chain of them has an end in itself.
    if (whole && (page.next == 0 || page.next == page.end())) {
      found.pages.push_back(std::move(page));
      continue;
    }
    if (!unfinished) found.fault = fmt::format("page {}: its directory is damaged", found.pages.size());
    return found;
  }
  if (!unfinished && maximum == SIZE_MAX && found.pages.back().end() != file.size())
    found.fault = fmt::format("page {}: is the last one, and bytes follow it", found.pages.size() - 1);
  return found;
}

/// The pages of a job by the names of their files.
struct PageIndex {
  struct stat stamp {};
  PageList pages;
  std::vector<ContainerEntry> files;                 // in the pages, then of the program; header: offset of the data
  std::string program;                               // the name of the program's file, without .part
  std::uint64_t program_start = 0, program_end = 0;  // of its layers

  void add_files() {
    for (const JobPage& page : pages.pages) {
      const PageContent& content = page.content;
      files.push_back({content.name, 0, content.bytes, page.file});
      if (content.program.empty()) continue;
      if (program.empty()) {
        program = "program" + content.program.substr(std::min(content.program.find('.'), content.program.size()));
        program_start = content.program_offset;
      }
      files.push_back({content.program, 0, content.program_bytes, content.program_offset});
      program_end = content.program_offset + content.program_bytes;
    }
    std::ranges::stable_sort(files, {}, &ContainerEntry::name);
  }
};

/// A folder of a path that is in the pages of a job, and its index.
struct PagedFolder {
  std::string directory, pages;
  std::shared_ptr<const PageIndex> index;
};

bool is_paged_folder(std::string_view folder) {
  const std::string_view name = folder.substr(folder.rfind('/') + 1);
  return name == "layers" || name == "program";
}

/// The file as it is called now: it has .part until the job is finished. "": it is absent
std::string present(const std::string& path) {
  struct stat status {};
  for (const std::string& name : {path, part_of(path)}) {
    if (::stat(name.c_str(), &status) == 0 && S_ISREG(status.st_mode)) return name;
  }
  return {};
}

std::shared_ptr<const PageIndex> page_index(const std::string& path) {
  static RecentFiles<PageIndex> recent;
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return nullptr;
  return recent.of(path, status, [&](PageIndex& index) {
    auto pages = read_pages(path);
    if (pages) index.pages = std::move(*pages);
    if (!pages) index.pages.fault = pages.error().message;
    index.add_files();
    return pages.ok();
  });
}

std::optional<PagedFolder> find_paged_folder(const std::string& folder) {
  struct stat status {};
  if (!is_paged_folder(folder) || ::stat(folder.c_str(), &status) == 0 || errno != ENOENT) return std::nullopt;
  PagedFolder found;
  const std::size_t slash = folder.rfind('/');
  found.directory = slash == std::string::npos ? "." : slash == 0 ? "/" : folder.substr(0, slash);
  found.pages = present(fmt::format("{}/{}", found.directory, kPagesFile));
  if (!found.pages.empty()) found.index = page_index(found.pages);
  return found.index ? std::optional(std::move(found)) : std::nullopt;
}

/// Bytes of one of the files of a job.
struct FileRange {
  std::string file;  // "": there is none
  std::uint64_t offset = 0, bytes = 0;
};

/// program/machine.toml, start.* and end.*, which no page names.
FileRange find_frame(const PagedFolder& folder, std::string_view name) {
  std::error_code error;
  const auto size_of = [&](const std::string& file) -> std::uint64_t {
    const std::uintmax_t size = file.empty() ? 0 : fs::file_size(file, error);
    return error ? 0 : size;
  };
  if (name == "program/machine.toml") {
    const std::string file = folder.directory + "/machine.toml";
    return is_file(file) ? FileRange{file, 0, size_of(file)} : FileRange{};
  }
  const PageIndex& index = *folder.index;
  if (index.program.empty()) return {};
  const std::string file = present(folder.directory + "/" + index.program), extension = index.program.substr(7);
  const std::uint64_t bytes = size_of(file);
  if (name == "program/start" + extension && index.program_start <= bytes) return {file, 0, index.program_start};
  if (name == "program/end" + extension && index.program_end < bytes)
    return {file, index.program_end, bytes - index.program_end};
  return {};
}

FileRange find_range(const PagedFolder& folder, std::string_view name) {
  const PageIndex& index = *folder.index;
  const auto at = std::ranges::lower_bound(index.files, name, {}, &ContainerEntry::name);
  if (at == index.files.end() || at->name != name) return find_frame(folder, name);
  const bool program = name.starts_with("program/");
  return {program ? present(folder.directory + "/" + index.program) : folder.pages, at->header, at->bytes};
}

/// DIR/layers and layers/NAME of DIR/layers/NAME.
std::pair<std::string, std::string> split_page_name(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  std::string folder = path.substr(0, slash);
  std::string name = folder.substr(folder.rfind('/') + 1) + path.substr(slash);
  return {std::move(folder), std::move(name)};
}

}  // namespace

Result<PageList> read_pages(const std::string& path) {
  const auto file = FileReader::open(path, {});
  return file ? Result<PageList>(walk_pages(*file, path.ends_with(part_of("")))) : file.error();
}

std::string pages_path(const std::string& directory) {
  const std::string whole = fmt::format("{}/{}", directory, kPagesFile);
  if (is_file(whole)) {
    const auto file = FileReader::open(whole, {});
    if (file && !walk_pages(*file, false, 1).pages.empty()) return whole;
  }
  return is_file(part_of(whole)) ? part_of(whole) : std::string();
}

bool is_page_name(std::string_view path) {
  const std::size_t slash = path.rfind('/');
  return slash != std::string_view::npos && is_paged_folder(path.substr(0, slash));
}

std::optional<OpenedEntry> open_in_pages(const std::string& path) {
  if (!is_page_name(path)) return std::nullopt;
  const auto [parent, name] = split_page_name(path);
  const auto folder = find_paged_folder(parent);
  if (!folder) return std::nullopt;
  const FileRange range = find_range(*folder, name);
  if (range.file.empty()) {
    errno = ENOENT;
    const std::string& fault = folder->index->pages.fault;
    return OpenedEntry{-1, 0, 0, fault.empty() ? "" : fmt::format("is not found: {}: {}", kPagesFile, fault)};
  }
  return OpenedEntry{::open(range.file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK), range.offset, range.bytes, {}};
}

std::optional<std::uint64_t> bytes_in_pages(const std::string& path) {
  if (!is_page_name(path)) return std::nullopt;
  const auto [parent, name] = split_page_name(path);
  const auto folder = find_paged_folder(parent);
  const FileRange range = folder ? find_range(*folder, name) : FileRange{};
  return range.file.empty() ? std::nullopt : std::optional(range.bytes);
}

std::vector<std::string> names_in_pages(const std::string& folder) {
  std::vector<std::string> names;
  const auto paged = find_paged_folder(folder);
  if (!paged) return names;
  const std::string below = folder.substr(folder.rfind('/') + 1) + "/";
  for (const ContainerEntry& file : paged->index->files) {
    if (file.name.starts_with(below)) names.push_back(file.name.substr(below.size()));
  }
  const std::string& program = paged->index->program;
  if (below != "program/" || program.empty()) return names;
  for (const std::string& name : {"machine.toml" + std::string(), "start" + program.substr(7), "end" + program.substr(7)}) {
    if (!find_frame(*paged, below + name).file.empty()) names.push_back(name);
  }
  return names;
}

std::vector<std::string> paged_job_files(const std::string& directory) {
  std::vector<std::string> files;
  if (pages_path(directory).empty()) return files;
  for (const std::string& name : names_in_folder(directory)) {
    if (name == kPagesFile || name == part_of(std::string(kPagesFile)) || name == "machine.toml" ||
        name.starts_with("program."))
      files.push_back(directory + "/" + name);
  }
  return files;
}

}  // namespace lamina
