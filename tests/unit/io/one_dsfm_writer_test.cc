#include "cairn/io/one_dsfm_writer.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

OneDsfmFiles MakeFiles() {
  OneDsfmFiles files;
  files.images = {{"images/a.jpg", 712.25}, {"images/b/c.jpg", {}}, {"images/d,e.jpg", 900.1}};
  files.component = {0, 2};
  Rng rng(1);
  for (int i = 0; i < 3; ++i) {
    OneDsfmEdge edge;
    edge.i = i;
    edge.j = (i + 1) % 3;
    const Eigen::Vector3d direction = RandomVector(rng).normalized();
    edge.cam_j_from_cam_i = Rigid3d(ExpSO3(RandomVector(rng)), direction);
    files.edges.push_back(edge);
    OneDsfmImageKeys keys;
    keys.index = i;
    keys.name = files.images[i].name;
    keys.principal_point << 400, 300.5;
    keys.focal_px = files.images[i].focal_px.value_or(0.0);
    for (int k = 0; k < 4 * i; ++k) {
      keys.keys.push_back({3 * k, {rng.Uniform(0, 800), rng.Uniform(0, 601)}, {1, 255, 0}});
    }
    files.coords.push_back(keys);
  }
  files.tracks = {{{1, 3}, {2, 6}}, {{0, 1}, {1, 0}, {2, 9}}};
  return files;
}

TEST(OneDsfmWriter, TheReadersGiveTheSameValuesBack) {
  const TempFolder folder;
  const OneDsfmFiles files = MakeFiles();
  WriteOneDsfmFiles(folder / "set", files);
  const OneDsfmDataset dataset = ReadOneDsfmDataset(folder / "set");
  ASSERT_EQ(dataset.images.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(dataset.images[i].name, files.images[i].name);
    EXPECT_EQ(dataset.images[i].focal_px, files.images[i].focal_px);
  }
  EXPECT_EQ(dataset.component, files.component);
  ASSERT_EQ(dataset.edges.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(dataset.edges[k].i, files.edges[k].i);
    EXPECT_EQ(dataset.edges[k].j, files.edges[k].j);
    const Rigid3d& read = dataset.edges[k].cam_j_from_cam_i;
    const Rigid3d& written = files.edges[k].cam_j_from_cam_i;
    EXPECT_LT(AngleBetween(read.rotation, written.rotation), 1e-12);
    EXPECT_LT((read.translation - written.translation).norm(), 1e-12);
  }
  const auto coords = ReadOneDsfmCoords(dataset.coords_path, 3);
  ASSERT_EQ(coords.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(coords[i].name, files.coords[i].name);
    EXPECT_EQ(coords[i].focal_px, files.coords[i].focal_px);
    EXPECT_EQ(coords[i].principal_point, files.coords[i].principal_point);
    ASSERT_EQ(coords[i].keys.size(), files.coords[i].keys.size());
    for (size_t k = 0; k < coords[i].keys.size(); ++k) {
      EXPECT_EQ(coords[i].keys[k].key, files.coords[i].keys[k].key);
      EXPECT_LT((coords[i].keys[k].pixel - files.coords[i].keys[k].pixel).norm(), 1e-9);
      EXPECT_EQ(coords[i].keys[k].color, files.coords[i].keys[k].color);
    }
  }
  EXPECT_EQ(ReadOneDsfmTracks(dataset.tracks_path, 3), files.tracks);
}

// The definition of src/io/FORMATS.md, written out: two cameras side by side that look the same
// way.
TEST(OneDsfmWriter, EdgesAreInBundlersFrame) {
  const TempFolder folder;
  OneDsfmFiles files;
  files.images = {{"images/a.jpg", {}}, {"images/b.jpg", {}}};
  // Camera j is 1 below camera i: c_j - c_i = (0, 1, 0) in our frame, (0, -1, 0) in Bundler's.
  files.edges = {
      {.i = 0, .j = 1, .cam_j_from_cam_i = Rigid3d(Eigen::Quaterniond(1, 0, 0, 0), {0, -1, 0})}};
  WriteOneDsfmFiles(folder.path(), files);
  EXPECT_EQ(ReadFile(folder / "EGs.txt"), "0 1 1 0 0 0 1 0 0 0 1 0 -1 0\n");
}

TEST(OneDsfmWriter, KeysAreSiftPixels) {
  const TempFolder folder;
  OneDsfmFiles files;
  files.images = {{"images/a.jpg", 700}};
  files.coords = {{.index = 0,
                   .name = "images/a.jpg",
                   .principal_point = {400, 300},
                   .focal_px = 700,
                   .keys = {{5, {0.5, 10.25}, {1, 2, 3}}}}};
  WriteOneDsfmFiles(folder.path(), files);
  EXPECT_EQ(ReadFile(folder / "coords.txt"),
            "#index = 0, name = images/a.jpg, keys = 1, px = 400, py = 300, focal = 700\n"
            "5 1 10.75 0 0 1 2 3\n");
  EXPECT_EQ(ReadFile(folder / "list.txt"), "images/a.jpg 0 700\n");
}

TEST(OneDsfmWriter, RefusesWhatTheFormatCannotHold) {
  const TempFolder folder;
  OneDsfmFiles files;
  files.images = {{"images/my photo.jpg", {}}};
  EXPECT_THAT(ThrownMessage<IoError>([&] { WriteOneDsfmFiles(folder.path(), files); }),
              AllOf(HasSubstr("list.txt"), HasSubstr("my photo.jpg")));
  files.images = {{"images/a.jpg", {}}};
  files.component = {1};
  EXPECT_THROW(WriteOneDsfmFiles(folder.path(), files), BugError);
}

}  // namespace
}  // namespace cairn
