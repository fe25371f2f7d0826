#include "stages/support/io/replaceable.h"

#include <sys/stat.h>

#include <algorithm>

#include "stages/support/io/file_reader.h"

namespace lamina::write {
namespace {

constexpr std::size_t kMarkedHead = 4096;  // bytes of a file in which its mark stands

}  // namespace

std::optional<FileId> file_id(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileId{status.st_dev, status.st_ino};
}

bool same_file(const std::string& a, const std::string& b) {
  const std::optional<FileId> first = file_id(a);
  return first && first == file_id(b);
}

bool is_file(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

bool is_stream(const std::string& path) {
  struct stat status {};
  const bool there = ::stat(path.c_str(), &status) == 0;
  return path == "-" || (there && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode));
}

bool is_replaceable(const std::string& path, std::span<const std::string_view> marks) {
  if (!is_file(path)) return true;
  const auto file = FileReader::open(path, {});
  std::string head(file ? static_cast<std::size_t>(std::min<std::uint64_t>(kMarkedHead, file->size())) : 0, '\0');
  const bool read = file && file->read_at(0, head);
  const bool marked = std::ranges::any_of(marks, [&](std::string_view mark) {
    if (mark.empty()) return false;
    return mark.front() == '^' ? head.starts_with(mark.substr(1)) : head.find(mark) != std::string::npos;
  });
  return read && (marked || head.empty());
}

}  // namespace lamina::write
