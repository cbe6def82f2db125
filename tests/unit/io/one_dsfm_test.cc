#include "cairn/io/one_dsfm.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

Eigen::Matrix3d BundlerFlip() { return Eigen::Vector3d(1, -1, -1).asDiagonal(); }

// EGs.txt's line for two cameras given in our frame, by the definition in src/io/FORMATS.md.
std::string EdgeLine(int i, int j, const Rigid3d& cam_i, const Rigid3d& cam_j) {
  const Eigen::Matrix3d Ri = BundlerFlip() * cam_i.RotationMatrix();
  const Eigen::Matrix3d Rj = BundlerFlip() * cam_j.RotationMatrix();
  const Eigen::Matrix3d R = Ri * Rj.transpose();
  const Eigen::Vector3d t = (Ri * (cam_j.Center() - cam_i.Center())).normalized();
  std::ostringstream line;
  line.precision(17);
  line << i << " " << j;
  for (int k = 0; k < 9; ++k) line << " " << R(k / 3, k % 3);
  line << " " << t.x() << " " << t.y() << " " << t.z() << "\n";
  return line.str();
}

Rigid3d RandomPose(Rng& rng) { return {ExpSO3(GaussianVector<3>(rng)), GaussianVector<3>(rng)}; }

TEST(OneDsfm, EdgesInOurFrame) {
  const TempFolder folder;
  Rng rng(3);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < 6; ++i) poses.push_back(RandomPose(rng));
  std::string text;
  for (int i = 0; i < 6; ++i) {
    for (int j = i + 1; j < 6; ++j) {
      text += (i + j) % 2 ? EdgeLine(i, j, poses[i], poses[j]) : EdgeLine(j, i, poses[j], poses[i]);
    }
  }
  WriteFileAtomically(folder / "EGs.txt", text);
  const std::vector<OneDsfmEdge> edges = ReadOneDsfmEdges(folder / "EGs.txt", 6);
  ASSERT_EQ(edges.size(), 15u);
  for (const OneDsfmEdge& edge : edges) {
    const Rigid3d truth = poses[edge.j] * Inverse(poses[edge.i]);
    EXPECT_LT(AngleBetween(edge.cam_j_from_cam_i.rotation, truth.rotation), 1e-12);
    EXPECT_LT((edge.cam_j_from_cam_i.translation - truth.translation.normalized()).norm(), 1e-12);
  }
}

struct Files {
  std::string list = "images/a.jpg 0 700\nimages/b.jpg\nimages/c.jpg\n";
  std::string cc = "2\n0\n";
  std::string egs = "0 2 1 0 0 0 1 0 0 0 1 0 0 -1\n";
};

void Write(const TempFolder& folder, const Files& files) {
  WriteFileAtomically(folder / "list.txt", files.list);
  WriteFileAtomically(folder / "cc.txt", files.cc);
  WriteFileAtomically(folder / "EGs.txt", files.egs);
}

std::string ErrorOf(const Files& files) {
  const TempFolder folder;
  Write(folder, files);
  return ThrownMessage<IoError>([&] { ReadOneDsfmDataset(folder.path()); });
}

TEST(OneDsfm, FolderAsAWhole) {
  const TempFolder folder;
  Write(folder, {});
  OneDsfmDataset dataset = ReadOneDsfmDataset(folder.path());
  ASSERT_EQ(dataset.images.size(), 3u);
  EXPECT_EQ(OneDsfmImageName(dataset.images[1].name), "b.jpg");
  EXPECT_EQ(OneDsfmImageName("other/b.jpg"), "other/b.jpg");
  EXPECT_EQ(dataset.images[0].focal_px, 700);
  EXPECT_THAT(dataset.component, ElementsAre(0, 2));
  ASSERT_EQ(dataset.edges.size(), 1u);
  // j's center is straight ahead: Bundler's -z, our +z, so a camera moved forward sees things
  // nearer.
  EXPECT_LT((dataset.edges[0].cam_j_from_cam_i.translation - Eigen::Vector3d(0, 0, -1)).norm(),
            1e-12);
  EXPECT_FALSE(dataset.has_photographs);
  EXPECT_EQ(dataset.coords_path, "");
  CreateFolders(folder / "images");
  dataset = ReadOneDsfmDataset(folder.path());
  EXPECT_TRUE(dataset.has_photographs);
  EXPECT_THROW(ReadOneDsfmDataset(folder / "absent"), IoError);
}

TEST(OneDsfm, BrokenFilesAreNamedWithTheLine) {
  EXPECT_EQ(ErrorOf({}), "no error");
  EXPECT_THAT(ErrorOf({.cc = "0\n3\n"}),
              HasSubstr("cc.txt:2: image index 3 is not in list.txt, which has 3 images"));
  EXPECT_THAT(ErrorOf({.cc = "0\n-1\n"}), HasSubstr("cc.txt:2: image index -1 is not in"));
  EXPECT_THAT(ErrorOf({.cc = "0\n\n0\n"}), HasSubstr("cc.txt:3: image index 0 appears twice"));
  EXPECT_THAT(ErrorOf({.cc = "x\n"}), HasSubstr("cc.txt:1: image index expected, not 'x'"));
  EXPECT_THAT(ErrorOf({.cc = "\n"}), HasSubstr("cc.txt: lists no image"));
  EXPECT_THAT(ErrorOf({.list = "images/a.jpg\nimages/b.jpg 0\nimages/c.jpg\n"}),
              HasSubstr("list.txt:2: '<name>' or '<name> 0 <focal length>' expected"));
  EXPECT_THAT(ErrorOf({.list = "images/a.jpg\nimages/b.jpg 0 abc\nimages/c.jpg\n"}),
              HasSubstr("list.txt:2: "));
  const std::string edge = Files().egs;
  EXPECT_THAT(ErrorOf({.egs = edge + "1 2 1 0 0 0 1 0 0 0 1 0 0\n"}),
              HasSubstr("EGs.txt:2: the line is too short: direction is missing"));
  EXPECT_THAT(ErrorOf({.egs = edge + "1 2 1 0 0 0 1 0 0 0 1 0 0 1 7\n"}),
              HasSubstr("EGs.txt:2: the line is too long"));
  EXPECT_THAT(ErrorOf({.egs = "1 3 1 0 0 0 1 0 0 0 1 0 0 1\n"}),
              HasSubstr("EGs.txt:1: image index 3 is not in list.txt"));
  EXPECT_THAT(ErrorOf({.egs = "1 1 1 0 0 0 1 0 0 0 1 0 0 1\n"}),
              HasSubstr("EGs.txt:1: an edge from image 1 to itself"));
  EXPECT_THAT(ErrorOf({.egs = edge + "2 0 1 0 0 0 1 0 0 0 1 0 0 1\n"}),
              HasSubstr("EGs.txt:2: the edge between images 2 and 0 appears twice"));
  EXPECT_THAT(ErrorOf({.egs = "1 2 1 0 0 0 1 0 0 0 -1 0 0 1\n"}),
              HasSubstr("EGs.txt:1: the matrix is not a rotation"));
  EXPECT_THAT(ErrorOf({.egs = "1 2 1 0 0 0 1 0 0 0 1 0 0 0\n"}),
              HasSubstr("EGs.txt:1: the direction is zero"));
}

TEST(OneDsfm, Coords) {
  const TempFolder folder;
  WriteFileAtomically(folder / "coords.txt",
                      "#index = 2, name = images/a, b = c.jpg keys = 2, px = 400.0, py = 300.5, "
                      "focal = 812.250\n"
                      "0 10.5 20.25 0 0 1 2 3\n"
                      "7 1 1 0.000 0.000 255 0 9\n"
                      "#index = 0, name = images/d.jpg, keys = 0, px = 1, py = 2\n");
  const auto images = ReadOneDsfmCoords(folder / "coords.txt", 3);
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].index, 2);
  EXPECT_EQ(images[0].name, "images/a, b = c.jpg");
  EXPECT_EQ(images[0].principal_point, Eigen::Vector2d(400, 300.5));
  EXPECT_EQ(images[0].focal_px, 812.25);
  ASSERT_EQ(images[0].keys.size(), 2u);
  EXPECT_EQ(images[0].keys[0].pixel, Eigen::Vector2d(10, 19.75));
  EXPECT_EQ(images[0].keys[1].key, 7);
  EXPECT_EQ(images[0].keys[1].pixel, Eigen::Vector2d(0.5, 0.5));
  EXPECT_THAT(images[0].keys[1].color, ElementsAre(255, 0, 9));
  EXPECT_EQ(images[1].name, "images/d.jpg");
  EXPECT_EQ(images[1].focal_px, 0);

  const auto error = [&](const std::string& text) -> std::string {
    WriteFileAtomically(folder / "coords.txt", text);
    return ThrownMessage<IoError>([&] { ReadOneDsfmCoords(folder / "coords.txt", 3); });
  };
  const std::string header = "#index = 1, name = a keys = 2, px = 1, py = 1, focal = 1\n";
  EXPECT_THAT(error(header + "0 1 1 0 0 1 2 3\n"),
              HasSubstr("coords.txt:2: the file ends after 1 of 2 keys"));
  EXPECT_THAT(error(header + "0 1 1 0 0 1 2 3\n1 1 1 0 0\n"),
              HasSubstr("coords.txt:3: the line is too short: color is missing"));
  EXPECT_THAT(error(header + "4 1 1 0 0 1 2 3\n4 2 2 0 0 1 2 3\n"),
              HasSubstr("coords.txt:3: key 4 appears twice"));
  EXPECT_THAT(error(header + header), HasSubstr("coords.txt:2: key expected, not '#index'"));
  EXPECT_THAT(error("0 1 1 0 0 1 2 3\n"), HasSubstr("coords.txt:1: a line '#index"));
  EXPECT_THAT(error("#index = 3, name = a keys = 0, px = 1, py = 1\n"),
              HasSubstr("coords.txt:1: image index 3 is not in list.txt, which has 3 images"));
  EXPECT_THAT(error("#index = nan, name = a keys = 0, px = 1, py = 1\n"),
              HasSubstr("coords.txt:1: "));
  EXPECT_THAT(error("#index = 1, name = a keys = 1e300, px = 1, py = 1\n"),
              HasSubstr("coords.txt:1: an impossible number of keys"));
}

TEST(OneDsfm, Tracks) {
  const TempFolder folder;
  WriteFileAtomically(folder / "tracks.txt", "2\n2 0 17 2 5\n3 0 1 1 2 2 3\n");
  const auto tracks = ReadOneDsfmTracks(folder / "tracks.txt", 3);
  ASSERT_EQ(tracks.size(), 2u);
  EXPECT_EQ(tracks[0][0], (OneDsfmObservation{0, 17}));
  EXPECT_EQ(tracks[1][2], (OneDsfmObservation{2, 3}));
  const auto error = [&](const std::string& text) -> std::string {
    WriteFileAtomically(folder / "tracks.txt", text);
    return ThrownMessage<IoError>([&] { ReadOneDsfmTracks(folder / "tracks.txt", 3); });
  };
  EXPECT_THAT(error("2\n1 0 1\n"), HasSubstr("tracks.txt:2: the file ends before track 2 of 2"));
  EXPECT_THAT(error("1\n2 0 1 1\n"), HasSubstr("tracks.txt:2: the line is too short: key"));
  EXPECT_THAT(error("1\n1 0 1 1\n"), HasSubstr("tracks.txt:2: the line is too long"));
  EXPECT_THAT(error("1\n1 0 1\n1 0 1\n"), HasSubstr("tracks.txt:3: more tracks than"));
  EXPECT_THAT(error("1\n1 3 1\n"), HasSubstr("tracks.txt:2: image index 3 is not in [0, 2]"));
  EXPECT_THAT(error("1000000000000\n"), HasSubstr("tracks.txt:1: the file ends before track 1"));
}

}  // namespace
}  // namespace cairn
