// tests/load/test_threemf_packages.cpp: ZIP files and XML of 3MF packages as programs write them, and as nobody should.
#include <fmt/format.h>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

using Entries = std::vector<std::pair<std::string, std::string>>;

Entries box_package() { return package(model(box_object(1, 1, 1, 1), item(1))); }

/// How the data of entries stand in a ZIP file (APPNOTE 6.3, sections 4.3.9 and 4.5.3).
enum class Packing { kStored, kDescribedBehind, kZip64 };

std::string packed_as(const Entries& entries, Packing how) {
  std::string file, directory;
  const bool behind = how == Packing::kDescribedBehind, large = how == Packing::kZip64;
  for (const auto& entry : entries) {
    const std::string &name = entry.first, &bytes = entry.second;
    const std::string data = how == Packing::kStored ? bytes : deflated(bytes, -MAX_WBITS);
    const auto crc =
        static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
    const std::string in = little(static_cast<std::uint32_t>(data.size()), 4),
                      out = little(static_cast<std::uint32_t>(bytes.size()), 4);
    const auto head = [&](bool known, const std::string& position) {
      std::string extra =
          large ? little(1, 2) + little(position.empty() ? 16 : 24, 2) + out + little(0, 4) + in + little(0, 4) : "";
      if (large && !position.empty()) extra += position + little(0, 4);
      const std::string sizes = little(crc, 4) + (large ? std::string(8, '\xff') : in + out);
      return little(large ? 45 : 20, 2) + little(behind ? 8 : 0, 2) + little(how == Packing::kStored ? 0 : 8, 2) +
             little(0x210000, 4) + (known ? sizes : std::string(12, '\0')) +
             little(static_cast<std::uint32_t>(name.size()), 2) + little(static_cast<std::uint32_t>(extra.size()), 2) +
             (position.empty() ? "" : std::string(10, '\0') + (large ? std::string(4, '\xff') : position)) + name + extra;
    };
    directory += "PK\x01\x02" + little(45, 2) + head(true, little(static_cast<std::uint32_t>(file.size()), 4));
    file += "PK\x03\x04" + head(!behind, "") + data + (behind ? "PK\x07\x08" + little(crc, 4) + in + out : "");
  }
  const auto count = static_cast<std::uint32_t>(entries.size()), size = static_cast<std::uint32_t>(directory.size()),
             position = static_cast<std::uint32_t>(file.size());
  const auto wide = [](std::uint32_t number) { return little(number, 4) + little(0, 4); };
  if (large)
    directory += "PK\x06\x06" + wide(44) + little(45, 2) + little(45, 2) + little(0, 4) + little(0, 4) + wide(count) +
                 wide(count) + wide(size) + wide(position) + "PK\x06\x07" + little(0, 4) + wide(position + size) + little(1, 4);
  return file + directory + "PK\x05\x06" + little(0, 4) + little(count, 2) + little(count, 2) + little(size, 4) +
         (large ? std::string(4, '\xff') : little(position, 4)) + little(0, 2);
}

TEST(Read3mfPackages, HowEntriesArePackedDoesNotMatter) {
  for (const Packing how : {Packing::kStored, Packing::kDescribedBehind, Packing::kZip64})
    EXPECT_EQ(placed(loaded(write_file("packed.3mf", packed_as(box_package(), how)))).size(), 12u) << static_cast<int>(how);
}

TEST(Read3mfPackages, NamesOfEntriesAreNoPaths) {
  for (const char* name :
       {"/3D/3dmodel.model", "../3D/3dmodel.model", "3D\\3dmodel.model", "x/../3d/3DModel.MODEL", "3D/%33dmodel.model"}) {
    Entries entries = box_package();
    entries[2].first = name;
    EXPECT_EQ(placed(loaded(write_file("names.3mf", zip(entries)))).size(), 12u) << name;
    entries.push_back(box_package()[2]);
    EXPECT_CONTAINS(refusal(write_file("twice.3mf", zip(entries))), "holds two entries of the name");
  }
}

TEST(Read3mfPackages, SizesThatLieDoNotHelpABomb) {
  Entries entries = box_package();
  entries[2].second.insert(entries[2].second.find("<resources>"), std::string(4u << 20, ' '));
  std::string bytes = zip(entries);
  const std::string size = little(static_cast<std::uint32_t>(entries[2].second.size()), 4);
  for (std::size_t at = 0; (at = bytes.find(size, at)) != bytes.npos;) bytes.replace(at, 4, little(5000, 4));
  load::LoadOptions options;
  options.expanded_limit = 100'000;
  EXPECT_CONTAINS(refusal(write_file("lie.3mf", bytes), options), "expands to more than the limit of 100000 bytes");
}

TEST(Read3mfPackages, TextOfOtherEncodingsIsReadOrNamed) {
  const std::string text = box_package()[2].second;
  const auto wide = [&](bool little_end) {
    std::string out = little_end ? "\xff\xfe" : "\xfe\xff";
    std::string plain = text;
    plain.replace(plain.find("UTF-8"), 5, "UTF-16");
    for (const char c : plain) (out += little_end ? c : '\0') += little_end ? '\0' : c;
    return out;
  };
  for (const std::string& model : {"\xef\xbb\xbf" + text, wide(true), wide(false)}) {
    const Part part = loaded(write_file("text.3mf", zip(package(model))));
    EXPECT_EQ(placed(part).size(), 12u);
  }
  EXPECT_CONTAINS(refusal(write_file("text.3mf", zip(package(wide(true).substr(0, 300))))), "is not well-formed XML");
}

TEST(Read3mfPackages, EntitiesAreRefusedWhereverTheyAre) {
  const std::string laugh = "<!DOCTYPE x [<!ENTITY a \"aaaa\">]>";
  for (const std::size_t part : {std::size_t{1}, std::size_t{2}}) {
    Entries entries = box_package();
    entries[part].second.insert(entries[part].second.find("?>") + 2, laugh);
    EXPECT_CONTAINS(refusal(write_file("laugh.3mf", zip(entries))), "has a document type, which 3MF forbids");
  }
}

TEST(Read3mfPackages, MuchOfAnythingTakesTimeInProportion) {
  // Components of one object, metadata, relationships, and meshes inside out that might be cavities of each other.
  std::string many, metadata, relationships;
  for (int i = 0; i < 10'000; ++i) {
    many += component(1, fmt::format("1 0 0 0 1 0 0 0 1 {} {} 0", 2 * (i % 200), 2 * (i / 200)));
    metadata += fmt::format("<metadata name=\"m{}\">{}</metadata>", i, i);
    relationships += fmt::format("<Relationship Id=\"r{}\" Target=\"/a{}\" Type=\"http://example.org/{}\"/>", i, i, i);
  }
  std::string box = box_object(1, 1, 1, 1);
  for (std::size_t at = 0; (at = box.find("x=\"1\"", at)) != box.npos;) box.replace(at, 5, "x=\"-1\"");
  std::string text = model(box + box_object(3, 500, 500, 500) + components(2, component(3) + many), item(2));
  Entries entries = package(text.insert(text.find("<resources>"), metadata));
  entries[1].second.insert(entries[1].second.find("</Rel"), relationships);
  const Part part = loaded(write_file("much.3mf", zip(entries)));
  EXPECT_EQ(part.instances.size(), 10'001u);
}

}  // namespace
}  // namespace lamina::test
