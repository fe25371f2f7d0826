// 3MF: the bytes of a package, and the model within a sound one.
#include <zlib.h>

#include <cstring>

#include "stages/load/load.h"
#include "tests/fuzz/laws.h"
#include "tests/load/archives.h"

namespace lamina::fuzz {
namespace {

bool load_package(std::string_view package, std::string_view decides) {
  static MemoryFile file("part.3mf");
  load::LoadOptions options;
  options.triangle_limit = 2000;
  options.expanded_limit = 1 << 20;
  Dice dice(decides);
  options.repair = dice.below(8) != 0;
  if (dice.below(4) == 0) options.transform = load::make_transform({-1, 2, 0.5}, {90, 10, -30}, {1, 1.02, 1});
  const Result<Part> part = load::load(file.hold(package), options);
  if (!part) return check_error(part.error()), false;
  check_part(*part, options.triangle_limit, options.repair);
  return true;
}

bool load_bytes(std::string_view bytes) { return load_package(bytes, bytes); }

std::string number(std::uint64_t value, int bytes) { return test::little(static_cast<std::uint32_t>(value), bytes); }

/// A zip file (APPNOTE 6.3) of stored entries.
std::string stored(const std::vector<std::pair<std::string, std::string>>& entries) {
  std::string file, directory;
  for (const auto& [name, bytes] : entries) {
    const auto sum = ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size()));
    const std::string common = number(20, 2) + number(0, 2) + number(0, 2) + number(0, 4) + number(sum, 4) +
                               number(bytes.size(), 4) + number(bytes.size(), 4) + number(name.size(), 2) + number(0, 2);
    directory += "PK\x01\x02" + number(20, 2) + common + number(0, 2) + number(0, 2) + number(0, 2) + number(0, 4) +
                 number(file.size(), 4) + name;
    file += "PK\x03\x04" + common + name + bytes;
  }
  return file + directory + "PK\x05\x06" + number(0, 4) + number(entries.size(), 2) + number(entries.size(), 2) +
         number(directory.size(), 4) + number(file.size(), 4) + number(0, 2);
}

/// The text is the root model; behind a line "=== NAME" lies another entry of the package.
bool load_model(std::string_view text) {
  auto entries = test::package("");
  std::string* to = &entries.back().second;
  std::size_t at = 0;
  while (at < text.size()) {
    std::size_t end = text.find('\n', at);
    if (end == text.npos) end = text.size();
    const std::string_view line = text.substr(at, end - at);
    if (line.starts_with("=== ") && entries.size() < 8) {
      // A name that stands there already takes the place of that entry: types and relationships too.
      const std::string name(line.substr(4));
      const auto known = std::ranges::find(entries, name, &std::pair<std::string, std::string>::first);
      to = known == entries.end() ? &entries.emplace_back(name, "").second : &known->second;
      to->clear();
    } else {
      to->append(line).push_back('\n');
    }
    at = end + 1;
  }
  return load_package(stored(entries), text);
}

std::vector<std::string> model_seeds() {
  const std::string transform = "1 0 0 0 1 0 0 0 1 12 3 0", turned = "0 1 0 -1 0 0 0 0 1 -5 0 2.5";
  const std::string whole =
      test::model(test::box_object(1, 10, 20, 5), test::item(1) + test::item(1, transform) + test::item(1, turned));
  const std::string assembly =
      test::model(test::box_object(1, 3, 3, 3) + test::components(2, test::component(1) + test::component(1, transform)) +
                      test::components(3, test::component(2, turned)),
                  test::item(3) + test::item(2, transform), "inch");
  std::string second = test::model(test::box_object(1, 10, 20, 5), "");
  const std::string production =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?><model unit=\"millimeter\" requiredextensions=\"p\" "
      "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
      "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\"><resources>" +
      test::box_object(4, 1, 2, 3, "type=\"model\" p:UUID=\"0f4c6d2a-0000-4000-8000-000000000004\"") +
      "</resources><build p:UUID=\"0f4c6d2a-0000-4000-8000-000000000001\"><item objectid=\"4\" "
      "p:UUID=\"0f4c6d2a-0000-4000-8000-000000000002\"/></build></model>";
  return {whole, assembly, production};
}

std::vector<std::string> package_seeds() {
  std::vector<std::string> seeds;
  for (const std::string& model : model_seeds()) {
    seeds.push_back(stored(test::package(model)));
    seeds.push_back(test::zip(test::package(model)));
  }
  return seeds;
}

std::uint32_t read(const std::uint8_t* bytes, int count) {
  std::uint32_t value = 0;
  for (int i = count; i-- > 0;) value = value << 8 | bytes[i];
  return value;
}

/// Sets the checksums of stored entries right, so that what they hold is read.
std::size_t mutate_package(std::uint8_t* bytes, std::size_t size, std::size_t, std::uint32_t) {
  for (std::size_t at = 0; at + 46 <= size; ++at) {
    if (std::memcmp(bytes + at, "PK\x01\x02", 4) != 0) continue;
    const std::uint64_t local = read(bytes + at + 42, 4), length = read(bytes + at + 20, 4);
    if (read(bytes + at + 10, 2) != 0 || local + 30 > size) continue;
    const std::uint64_t begin = local + 30 + read(bytes + local + 26, 2) + read(bytes + local + 28, 2);
    if (begin > size || length > size - begin) continue;
    const auto sum = static_cast<std::uint32_t>(::crc32(0, bytes + begin, static_cast<uInt>(length)));
    std::memcpy(bytes + at + 16, &sum, 4);
    std::memcpy(bytes + local + 14, &sum, 4);
  }
  return size;
}

const Registered kModel({"threemf_model", load_model, model_seeds, "stages/load stages/data", ".model", "threemf.dict", 6000});
const Registered kPackage({"threemf_package", load_bytes, package_seeds, "stages/load stages/data", ".3mf", "zip.dict", 6000,
                           mutate_package});

}  // namespace
}  // namespace lamina::fuzz
