#include "cairn/image/image_folder.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(ImageFolder, ListsPhotographsRecursivelySorted) {
  const TempFolder folder;
  for (const char* name : {"b", "a/deep", ".hidden"}) CreateFolders(folder / name);
  for (const char* name : {"z.jpg", "B.JPG", "b/1.jpeg", "b/2.Png", "a/deep/x.tif", "a/deep/y.TIFF",
                           "c.bmp", "d.ppm", "e.webp", "f.pgm", "g.JFIF", "h.jpe", "notes.txt",
                           "f.jpg.npy", ".g.jpg", ".hidden/h.jpg", "jpg"}) {
    WriteFileAtomically(folder / name, "");
  }
  EXPECT_THAT(ListImages(folder.path()),
              ElementsAre("B.JPG", "a/deep/x.tif", "a/deep/y.TIFF", "b/1.jpeg", "b/2.Png", "c.bmp",
                          "d.ppm", "e.webp", "f.pgm", "g.JFIF", "h.jpe", "z.jpg"));
}

TEST(ImageFolder, ListsRawFilesAndVideosApart) {
  const TempFolder folder;
  for (const char* name : {"a.HEIC", "b.NRW", "c.mpo", "d.gpr", "e.insv", "f.jpg", "g.txt"}) {
    WriteFileAtomically(folder / name, "");
  }
  EXPECT_THAT(ListUnreadImages(folder.path()),
              ElementsAre("a.HEIC", "b.NRW", "c.mpo", "d.gpr", "e.insv"));
}

TEST(ImageFolder, FollowsLinksOnceEvenInACycle) {
  const TempFolder folder;
  const TempFolder other;
  CreateFolders(folder / "a");
  WriteFileAtomically(other / "1.jpg", "");
  std::filesystem::create_directory_symlink(other.path(), folder / "a/linked");
  std::filesystem::create_directory_symlink(other.path(), folder / "again");
  std::filesystem::create_symlink(other / "1.jpg", folder / "file.jpg");
  std::filesystem::create_directory_symlink(folder.path(), folder / "a/up");
  EXPECT_THAT(ListImages(folder.path()), ElementsAre("a/linked/1.jpg", "again/1.jpg", "file.jpg"));
}

// undistort --output_path PHOTOS/dense must not make photographs of the next build_view_graph.
TEST(ImageFolder, UndistortedImagesAreNoPhotographs) {
  const TempFolder folder;
  for (const char* name : {"dense/images/cam1", "images"}) CreateFolders(folder / name);
  for (const char* name :
       {"dense/.cairn-images", "dense/images/cam1/1.jpg", "dense/2.jpg", "images/1.jpg"}) {
    WriteFileAtomically(folder / name, "");
  }
  EXPECT_THAT(ListImages(folder.path()), ElementsAre("dense/2.jpg", "images/1.jpg"));
  EXPECT_THAT(ListImages(folder / "dense/images"), ElementsAre("cam1/1.jpg"));
}

TEST(ImageFolder, LeavesOutFoldersOfMasksAndDepth) {
  const TempFolder folder;
  for (const char* name : {"masks", "depth/deep"}) CreateFolders(folder / name);
  for (const char* name : {"1.jpg", "masks/1.jpg.png", "depth/2.jpg", "depth/deep/1.jpg.png"}) {
    WriteFileAtomically(folder / name, "");
  }
  const std::vector<std::string> left_out = {folder / "masks/../masks", folder / "depth/deep", "",
                                             folder / "absent", folder.path()};
  EXPECT_THAT(ListImages(folder.path(), left_out), ElementsAre("1.jpg", "depth/2.jpg"));
}

TEST(ImageFolder, EmptyAndAbsent) {
  const TempFolder folder;
  EXPECT_THAT(ListImages(folder.path()), IsEmpty());
  EXPECT_THROW(ListImages(folder / "absent"), IoError);
  WriteFileAtomically(folder / "file", "");
  EXPECT_THROW(ListImages(folder / "file"), IoError);
}

}  // namespace
}  // namespace cairn
