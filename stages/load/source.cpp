#include "stages/load/source.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace lamina::load {
namespace {

constexpr ReadRules kRules{.fault = Fault::kInput,
                           .missing = "cannot be opened: No such file or directory",
                           .directory = "is a directory; name a part file (STL, OBJ or 3MF)",
                           .device = "is not a regular file; write the part to a file first"};

}  // namespace

Result<Source> Source::open(const std::string& path) {
  if (path == "-") return Error{Fault::kInput, "-: parts are not read from standard input; write it to a file first"};
  auto file = FileReader::open(path, kRules);
  if (!file) return file.error();
  Source source;
  source.path_ = path;
  source.size_ = file->size();
  source.file_.emplace(std::move(*file));
  return source;
}

Source Source::of_memory(std::string path, Buffer<char> bytes) {
  Source source;
  source.path_ = std::move(path);
  source.size_ = bytes.size();
  source.memory_ = std::move(bytes);
  return source;
}

bool Source::read(std::uint64_t offset, char* to, std::size_t count) const {
  if (offset > size_ || count > size_ - offset) return false;
  if (file_) return file_->read_at(offset, {to, count});
  if (count > 0) std::memcpy(to, memory_.data() + offset, count);
  return true;
}

std::string Source::head(std::size_t count) const {
  std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(count, size_)), '\0');
  if (!read(0, bytes.data(), bytes.size())) bytes.clear();
  return bytes;
}

}  // namespace lamina::load
