#include "stages/formats/images/numbered.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "stages/support/text/readable.h"

namespace lamina::formats {

namespace fs = std::filesystem;

constexpr std::string_view kReadEndings[] = {".png", ".tif", ".tiff", ".pbm", ".pgm", ".bmp"};
constexpr std::string_view kUnreadEndings[] = {".jpg", ".jpeg", ".gif", ".webp", ".tga", ".jp2", ".ppm"};

Result<std::vector<Numbered>> numbered_images(const std::string& folder, bool gaps) {
  std::vector<Numbered> images;
  std::string nested;  // the first folder in it
  std::error_code wrong;
  // A range-based loop would throw where reading goes wrong on the way.
  for (fs::directory_iterator entry(folder, wrong); !wrong && entry != fs::directory_iterator(); entry.increment(wrong)) {
    const fs::path& path = entry->path();
    const std::string ending = lower_case(path.extension().string()), stem = path.stem().string();
    if (stem.starts_with('.')) continue;  // files of other systems next to images: ._0001.tif
    std::error_code ignored;
    if (entry->is_directory(ignored)) {
      nested = nested.empty() ? path.string() : std::min(nested, path.string());
      continue;
    }
    const bool is_read = std::ranges::find(kReadEndings, ending) != std::end(kReadEndings);
    if (!is_read && std::ranges::find(kUnreadEndings, ending) == std::end(kUnreadEndings)) continue;
    const std::size_t last = stem.find_last_of("0123456789");
    const std::size_t before = last == std::string::npos ? last : stem.find_last_not_of("0123456789", last);
    if (!is_read) {
      if (last == std::string::npos) continue;
      return Error{Fault::kInput, fmt::format("{}: is of a format that is not read; bring the images to PNG, TIFF, BMP or PBM",
                                              one_line(path.string()))};
    }
    const std::string digits = last == std::string::npos ? "" : stem.substr(before + 1, last - before);
    if (digits.empty() || digits.size() > 18)
      return Error{Fault::kInput, fmt::format("{}: has no number in its name that tells its layer; name it as a0001.png, or "
                                              "move it elsewhere",
                                              one_line(path.string()))};
    images.push_back({std::stoull(digits), path.string()});
  }
  if (wrong) return Error{Fault::kInput, fmt::format("{}: the folder cannot be read: {}", one_line(folder), wrong.message())};
  if (images.empty() && !nested.empty())
    return Error{Fault::kInput,
                 fmt::format("{}: holds no images, but folders; name one of them, as {}", one_line(folder), one_line(nested))};
  if (images.empty())
    return Error{Fault::kInput, fmt::format("{}: holds neither manifest.json of lamina jet nor images .png, .tif, .bmp or .pbm",
                                            one_line(folder))};
  std::ranges::sort(images, [](const Numbered& a, const Numbered& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  for (std::size_t i = 1; i < images.size(); ++i) {
    if (images[i].number == images[i - 1].number + 1 || (gaps && images[i].number != images[i - 1].number)) continue;
    if (images[i].number == images[i - 1].number)
      return Error{Fault::kInput, fmt::format("{}: has the number of {}; a layer is one image", one_line(images[i].path),
                                              one_line(fs::path(images[i - 1].path).filename().string()))};
    return Error{Fault::kInput, fmt::format("{}: number {} is missing before it; put the image there, or number them anew",
                                            one_line(images[i].path), images[i - 1].number + 1)};
  }
  return images;
}

Runs inverse(const Runs& image) {
  Runs out;
  out.columns = image.columns;
  out.row_offset.assign(1, 0);
  for (std::uint32_t r = 0; r < image.view().rows(); ++r) {
    const auto row = image.view().row(r);
    const bool from_first = row.empty() || row.front() > 0, to_last = row.empty() || row.back() < image.columns;
    if (from_first) out.change.push_back(0);
    for (const std::uint32_t c : row)
      if (c > 0 && c < image.columns) out.change.push_back(c);
    if (to_last) out.change.push_back(image.columns);
    out.row_offset.push_back(static_cast<std::uint32_t>(out.change.size()));
  }
  return out;
}

}  // namespace lamina::formats
