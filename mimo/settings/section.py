"""What a section of params.yaml is, and the ranges that several sections share."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Steps = Annotated[int, Field(gt=0, le=20_000)]  # of a phase; a chunk's records then fit in memory
Updates = Annotated[int, Field(gt=0, le=2000)]
Worlds = Annotated[int, Field(gt=0, le=64)]
Seeds = Annotated[int, Field(gt=0, le=1000)]  # files are numbered with three digits
Width = Annotated[int, Field(gt=0, le=32)]
Rate = Annotated[float, Field(ge=1e-6, le=0.1)]  # Adam moves a weight by as much in a step, in float32
Factor = Annotated[float, Field(ge=0.001, le=100)]  # of what is computed in float32, and divided by
Limb = Literal["left_foot", "right_foot", "left_hand", "right_hand"]
Condition = Literal["free", "noisy"]


class Section(BaseModel):
    """A part of params.yaml: unknown keys, text for numbers and later changes are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
