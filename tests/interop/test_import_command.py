"""`pe import-official` as its user meets it."""

from command_line import result, run


def test_the_command_says_what_came_of_the_files(capsys, files, tmp_path):
    model = tmp_path / "made" / "minecraft.safetensors"
    found = result(capsys, "import-official", *files["minecraft"], "-o", model)
    assert found["model"] == str(model)
    assert found["world"] == "minecraft"
    assert found["same_environment"] is True
    assert found["files"] == {"minecraft_2.pth.tar": 300000, "minecraft_3.pth.tar": 150000}
    assert len(found["actions"]["player"]) == 7
    facts = result(capsys, "info", model)
    assert facts["size"] == "512x288"
    assert facts["objects"]["player_2"] == "player"
    assert facts["actions"]["player_1"] == found["actions"]["player"]


def test_in_words_it_names_the_actions_and_the_licence(capsys, files, tmp_path):
    code, out, _ = run(
        capsys, "import-official", files["tennis"][0], "-o", tmp_path / "a.safetensors"
    )
    assert code == 0
    assert "give the stage-3 checkpoint as well" in out
    assert "does not allow commercial use" in out


def test_a_file_that_does_not_fit_is_one_line_and_exit_code_one(capsys, files, tmp_path):
    wrong = tmp_path / "wrong.pth.tar"
    wrong.write_text("no checkpoint")
    code, out, err = run(capsys, "import-official", wrong, "-o", tmp_path / "a.safetensors")
    assert (code, out) == (1, "")
    assert err.startswith("pe: ")
    assert err.count("\n") == 1
    code, _, err = run(
        capsys, "import-official", files["tennis"][0], "-o", tmp_path / "a", "--world", "minecraft"
    )
    assert code == 1
    assert "of tennis" in err
