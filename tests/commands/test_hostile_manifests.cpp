// tests/commands/test_hostile_manifests.cpp: manifests that hold together (their id is no signature) and that lamina cannot
// have written are refused by all that read them, and nothing outside of the job's folder is read or written for them.
#include <gtest/gtest.h>

#include <functional>

#include "pipeline/manifest/manifest.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

struct Mutation {
  const char* name;
  std::function<void(Manifest&)> make;
};

/// The writer's own text of a changed manifest, with the id that belongs to it.
void write_again(const std::string& path, Manifest manifest, const Mutation& mutation) {
  mutation.make(manifest);
  auto writer = ManifestWriter::open(path, manifest.head, {});
  ASSERT_TRUE(writer.ok()) << writer.error().message;
  for (const LayerRecord& record : manifest.layers) ASSERT_TRUE(writer->append(record).ok());
  ASSERT_TRUE(writer->finish(manifest.file).ok());
}

void grow(PixelAxis& axis, std::int64_t dots, std::int64_t length, std::int64_t span) {
  axis.dots = dots;
  axis.length = length;
  axis.span = span;
}

const Mutation kOfImages[] = {
    {"an extension that leads out", [](Manifest& m) { m.head.extension = "/../../../pwned.tif"; }},
    {"an extension of another format", [](Manifest& m) { m.head.extension = ".png"; }},
    {"no extension", [](Manifest& m) { m.head.extension = ""; }},
    {"a format that is none", [](Manifest& m) { m.head.format = "tiff-g5"; }},
    {"a file", [](Manifest& m) { m.head.file = "../pwned.tif"; }},
    {"programs that lead out", [](Manifest& m) { m.head.program_extension = "/../../../pwned.gcode"; }},
    {"programs of another dialect", [](Manifest& m) { m.head.program_extension = ".gcode"; }},
    {"a dialect that is none", [](Manifest& m) { m.head.dialect = "klingon"; }},
    {"a part above", [](Manifest& m) { m.head.parts[0].path = ".."; }},
    {"no dots", [](Manifest& m) { grow(m.head.grid.x, 0, 1, 25'400'000); }},
    {"too many dots", [](Manifest& m) { grow(m.head.grid.x, INT64_MAX, INT64_MAX, 25'400'000); }},
    {"a bed of nothing", [](Manifest& m) { grow(m.head.grid.y, 600, 0, 25'400'000); }},
    {"a bed below zero", [](Manifest& m) { grow(m.head.grid.y, 600, -5, 25'400'000); }},
    {"pixels of nothing", [](Manifest& m) { grow(m.head.grid.y, 1000, 1'000'000, 1); }},
    {"a layer below the bed", [](Manifest& m) { m.layers[1].layer.bottom = -1'000'000; }},
    {"a layer of nothing", [](Manifest& m) { m.layers[1].layer.thickness = 0; }},
    {"a layer beyond reach", [](Manifest& m) { m.layers[1].layer.thickness = INT32_MAX; }},
};
const Mutation kOfMaterials[] = {
    {"a material that leads out",
     [](Manifest& m) {
       m.head.materials = {{"/../../../pwned", 0}, {"b", 1}};
     }},
    {"a material of no name",
     [](Manifest& m) {
       m.head.materials = {{"", 0}, {"b", 1}};
     }},
    {"a material with a dot",
     [](Manifest& m) {
       m.head.materials = {{"..", 0}, {"b", 1}};
     }},
    {"one material twice",
     [](Manifest& m) {
       m.head.materials = {{"b", 0}, {"b", 1}};
     }},
};

class HostileManifests : public ::testing::Test {
 protected:
  HostileManifests() {
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    fs::create_directories(directory_ / "deep/er");
  }
  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  void done(const std::string& line) {
    const Outcome outcome = run(line);
    ASSERT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  /// Every use ends with exit code 5 in one line and leaves all files as they are, but for the page that none of them writes.
  void refused_everywhere(const std::string& what, const std::vector<std::string>& uses) {
    const std::string before = tree_text(directory_.path());
    for (const std::string& use : uses) {
      const Outcome outcome = run(use);
      EXPECT_EQ(outcome.code, 5) << use << ": " << what << "\n" << outcome.err;
      EXPECT_EQ(outcome.error_lines(), 1u) << use << ": " << what << "\n" << outcome.err;
      EXPECT_TRUE(tree_text(directory_.path()) == before) << use << ": " << what;
    }
  }

  Directory directory_;
};

TEST_F(HostileManifests, OfImagesAreRefusedByAllThatReadThem) {
  const std::string job = "jet part.stl --machine hp45 --layer 1 --quiet -o deep/er/out";
  done(job);
  const std::string path = directory_ / "deep/er/out/manifest.json";
  const auto sound = read_manifest(path);
  ASSERT_TRUE(sound.ok());
  const std::vector<std::string> all = {"verify deep/er/out",
                                        "report deep/er/out -o page.html",
                                        "preview deep/er/out -o page.png",
                                        "merge deep/er/out -o deep/er/out",
                                        "merge deep/er/out -o new",
                                        job + " --resume"};
  std::size_t turn = 0;
  for (const Mutation& mutation : kOfImages) {
    write_again(path, *sound, mutation);
    // The first by all, the others by two in turn: all read through one function.
    refused_everywhere(mutation.name, turn == 0 ? all : std::vector{all[turn % 6], all[(turn + 3) % 6]});
    ++turn;
  }
  // Errors that only a check of the files reports.
  write_again(path, *sound, {"", [](Manifest& manifest) { manifest.layers[1].bytes = UINT64_MAX; }});
  refused_everywhere("a layer of many bytes", {all[0], all[1], all[3]});
  write_again(path, *sound, {"", [](Manifest&) {}});
  done("verify deep/er/out");
}

TEST_F(HostileManifests, OfMaterialsAreRefused) {
  done("jet part.stl --layer 1 --dpi 60 --quiet -o deep/er/out");
  const std::string path = directory_ / "deep/er/out/manifest.json";
  const auto sound = read_manifest(path);
  ASSERT_TRUE(sound.ok());
  for (const Mutation& mutation : kOfMaterials) {
    write_again(path, *sound, {mutation.name, [&](Manifest& manifest) {
                                 mutation.make(manifest);
                                 for (LayerRecord& record : manifest.layers) record.images.resize(2);
                               }});
    refused_everywhere(mutation.name, {"verify deep/er/out", "report deep/er/out -o page.html",
                                       "preview deep/er/out -o page.png", "merge deep/er/out -o new"});
  }
}

TEST_F(HostileManifests, OfContoursAndToolpathsAreRefused) {
  done("slice part.stl --layer 1 --quiet -o cut");
  done("extrude part.stl --machine anet-a8 --layer 0.3 --quiet -o part.gcode");
  for (const auto& [path, uses] : {std::pair<std::string, std::vector<std::string>>{"cut/manifest.json", {"verify cut"}},
                                   {"part.gcode.json", {"verify part.gcode", "report part.gcode -o page.html"}}}) {
    const auto sound = read_manifest(directory_ / path);
    ASSERT_TRUE(sound.ok());
    const Mutation mutations[] = {
        {"a file that leads out", [](Manifest& m) { m.head.file = "../part.svg"; }},
        {"a file of another root", [](Manifest& m) { m.head.file = "/etc/passwd"; }},
        {"the folder itself", [](Manifest& m) { m.head.file = "."; }},
        {"no file", [](Manifest& m) { m.head.file = ""; }},
        {"both an extension and a file", [](Manifest& m) { m.head.extension = "/../../x.svg"; }},
        {"a format that is none", [](Manifest& m) { m.head.format = "dxf"; }},
        {"a part above", [](Manifest& m) { m.head.parts[0].path = "a/.."; }},
    };
    for (const Mutation& mutation : mutations) {
      write_again(directory_ / path, *sound, mutation);
      refused_everywhere(path + ": " + mutation.name, uses);
    }
    write_again(directory_ / path, *sound, {"", [](Manifest&) {}});
    done(uses.front());
  }
}

TEST_F(HostileManifests, NestedAndTornHeadsAreRefused) {
  done("jet part.stl --layer 1 --dpi 60 --quiet -o out");
  const fs::path path = directory_ / "out/manifest.json";
  const std::string sound = read_text(path);
  const std::size_t position = sound.find("\"notes\":[") + 9, name = sound.find("part.stl\",\"copies");
  ASSERT_GT(position, 9u);
  ASSERT_NE(name, std::string::npos);
  for (const std::string& text :
       {sound.substr(0, position) + std::string(200'000, '[') + sound.substr(position),
        sound.substr(0, name) + "../" + sound.substr(name), sound.substr(0, position - 5), std::string("{\n"), std::string(),
        std::string(1000, '\0'), sound.substr(0, sound.size() - 3) + std::string(5000, ' ')}) {
    write_text(path, text);
    refused_everywhere("head", {"verify out", "report out -o page.html", "preview out -o page.png", "merge out -o new"});
  }
}

TEST_F(HostileManifests, MergeDoesNotFollowLinks) {
  done("jet part.stl --layer 1 --dpi 60 --quiet --shard 1/2 -o a");
  done("jet part.stl --layer 1 --dpi 60 --quiet --shard 2/2 -o b");
  fs::create_directory(directory_ / "elsewhere");
  fs::create_directory(directory_ / "out");
  fs::create_directory_symlink("../elsewhere", directory_ / "out/layers");
  for (const std::string use : {"merge a b -o out", "jet part.stl --layer 1 --dpi 60 --quiet -o out"}) {
    const Outcome outcome = run(use);
    EXPECT_EQ(outcome.code, 4) << outcome.err;
    EXPECT_NE(outcome.err.find("out/layers: is a link that leads out of out"), std::string::npos) << outcome.err;
    EXPECT_TRUE(fs::is_empty(directory_ / "elsewhere"));
  }
  fs::copy(directory_ / "a/layers/000000.tif", directory_ / "elsewhere/same.tif");
  fs::remove(directory_ / "a/layers/000000.tif");
  fs::create_symlink("../../elsewhere/same.tif", directory_ / "a/layers/000000.tif");
  refused_everywhere("a link in a shard", {"merge a b -o a"});
}

}  // namespace
}  // namespace lamina::test
