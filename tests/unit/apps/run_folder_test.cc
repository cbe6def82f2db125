#include "global_sfm/run_folder.h"

#include "cairn/base/file.h"
#include "cairn/view_graph/view_graph_text.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

// A run that made no model writes no confidences, and its report says why.
TEST(RunFolder, OfARunWithoutAModelIsRead) {
  const TempFolder folder;
  WriteFileAtomically(folder / "report.json", R"({"succeeded": false, "failure": "no pair"})");
  ViewGraph graph;
  graph.image_ids = {1, 2};
  WriteFileAtomically(folder / "view_graph.json", ViewGraphToJson(graph, {}));
  const RunFolder run = ReadRunFolder(folder.path());
  EXPECT_TRUE(run.models.empty());
  EXPECT_TRUE(run.confidences.empty());
  EXPECT_EQ(run.graph.image_ids.size(), 2u);
}

TEST(RunFolder, IsThatOfItsModels) {
  const TempFolder folder;
  const std::string run = folder / "run";
  CreateFolders(run + "/sparse/0");
  for (const char* name : {"/report.json", "/effective.toml"}) WriteFileAtomically(run + name, "");
  for (const char* path : {"", "/", "/sparse", "/sparse/", "/sparse/0"}) {
    EXPECT_EQ(RunFolderOf(run + path), run) << path;
  }
  for (const char* path : {"/images", "/images/0", "/.."}) {
    EXPECT_EQ(RunFolderOf(run + path), "") << path;
  }
}

}  // namespace
}  // namespace cairn
