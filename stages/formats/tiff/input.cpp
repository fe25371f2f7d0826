#include "stages/formats/tiff/input.h"

#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <utility>

namespace lamina::formats::tiff {
namespace {

constexpr std::uint32_t kLargestAllocation = 64 << 20;  // bytes; no strip that anybody writes is larger

}  // namespace

tmsize_t Input::read(thandle_t handle, void* to, tmsize_t count) {
  Input& input = *static_cast<Input*>(handle);
  auto* const bytes = static_cast<std::uint8_t*>(to);
  tmsize_t all = 0;
  while (all < count) {
    const ssize_t got =
        ::pread(input.file_, bytes + all, static_cast<std::size_t>(count - all), static_cast<off_t>(input.position_) + all);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    all += got;
  }
  const std::uint64_t begin = std::exchange(input.position_, input.position_ + static_cast<std::uint64_t>(all));
  for (std::uint64_t at = begin; at < std::min<std::uint64_t>(input.header_.size(), input.position_); ++at)
    bytes[at - begin] = input.header_[at];
  return all;
}

toff_t Input::seek(thandle_t handle, toff_t offset, int whence) {
  Input& input = *static_cast<Input*>(handle);
  return input.position_ = offset + (whence == SEEK_SET ? 0 : whence == SEEK_CUR ? input.position_ : input.size_);
}

toff_t Input::size_of(thandle_t handle) { return static_cast<Input*>(handle)->size_; }

void Input::name_first_directory(std::uint64_t page) {
  constexpr std::uint8_t kBigTiff = 43;
  header_.resize(16);
  if (::pread(file_, header_.data(), header_.size(), 0) != static_cast<ssize_t>(header_.size())) return header_.clear();
  const bool low_first = header_[0] == 'I', big = header_[low_first ? 2 : 3] == kBigTiff;
  const std::size_t size = big ? 8 : 4;
  if (!big) header_.resize(2 * size);
  for (std::size_t i = 0; i < size; ++i)
    header_[size + i] = static_cast<std::uint8_t>(page >> 8 * (low_first ? i : size - 1 - i));
}

Input::Input(int file, const std::string& path, std::uint64_t page) : file_(file) {
  if (page != 0) name_first_directory(page);
  const auto options = strict_tiff_options(message);
  struct stat status {};
  if (options == nullptr || ::fstat(file, &status) != 0) return;
  size_ = static_cast<std::uint64_t>(status.st_size);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kLargestAllocation);
  handle_.reset(TIFFClientOpenExt(
      path.c_str(), "rCm", this, read, [](thandle_t, void*, tmsize_t) -> tmsize_t { return 0; }, seek,
      [](thandle_t) { return 0; }, size_of, nullptr, nullptr, options.get()));
}

}  // namespace lamina::formats::tiff
